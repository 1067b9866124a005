// Messages and beliefs of 8 bits.

const BITS: u32 = 8u;
// The values of four labels.
alias Quad = u32;

fn unpack(quad: Quad) -> vec4<u32> {
    return unpack_narrow(quad);
}

fn pack(values: vec4<u32>) -> Quad {
    return pack_narrow(values);
}
