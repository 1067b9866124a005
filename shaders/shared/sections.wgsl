// Stages that may process several levels in one dispatch: the workgroups have a section for each level.

@group(0) @binding(0) var<uniform> sections: array<Params, SECTIONS>;
// The parameters of the section that this workgroup belongs to.
var<private> params: Params;

// Loads `params`.
fn enter(group: vec3<u32>) {
    let linear = group.x + group.y * sections[0].band.grid;
    var section = 0u;
    for (var i = 1u; i < sections[0].band.sections; i++) {
        section += u32(linear >= sections[i].band.first_group);
    }
    params = sections[section];
}
