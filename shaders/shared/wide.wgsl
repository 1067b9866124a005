// Messages and beliefs of 16 bits.

const BITS: u32 = 16u;
// The values of four labels.
alias Quad = vec2<u32>;

fn unpack(quad: Quad) -> vec4<u32> {
    return unpack_wide(quad);
}

fn pack(values: vec4<u32>) -> Quad {
    return pack_wide(values);
}
