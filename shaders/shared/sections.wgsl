// A stage that may go over several levels in one dispatch, one section of the workgroups after the other.

@group(0) @binding(0) var<uniform> sections: array<Params, SECTIONS>;
// Those of the section that the workgroup belongs to.
var<private> params: Params;

// Finds them.
fn enter(group: vec3<u32>) {
    let linear = group.x + group.y * sections[0].band.grid;
    var section = 0u;
    for (var i = 1u; i < sections[0].band.sections; i++) {
        section += u32(linear >= sections[i].band.first_group);
    }
    params = sections[section];
}
