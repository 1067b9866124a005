//! The parameters of a kernel: one uniform buffer per dispatch. All begin with the same header; the rest
//! belongs to the stage.

use crate::plan::{LABEL_BLOCK, LevelPlan, Plan, ROW_ALIGN};
use bytemuck::{Pod, Zeroable};

/// Rows of every buffer start at a multiple of this many 32-bit words.
pub(super) const ALIGN_WORDS: usize = ROW_ALIGN / 4;

/// Declares fields with their names and offsets, for the tests that compare them with the shaders.
macro_rules! layout {
    ($type:ident: $($field:ident),*) => {
        impl $crate::backend::gpu::uniform::Layout for $type {
            const FIELDS: &'static [(&'static str, usize)] =
                &[$( (stringify!($field), std::mem::offset_of!($type, $field)), )*];
        }
    };
}

pub(super) use layout;

/// Names and offsets of the fields of a struct, in bytes. Fields whose names start with `padding` do not
/// exist in the shader.
pub(super) trait Layout: Pod {
    /// Every field.
    const FIELDS: &'static [(&'static str, usize)];
}

/// `Level` of `shaders/shared/band.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub(super) struct LevelParams {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) low: i32,
    pub(super) labels: u32,
    pub(super) quads: u32,
    pub(super) pitch: u32,
    pub(super) dependency_pitch: u32,
    pub(super) member_pitch: u32,
    pub(super) pixel_pitch: u32,
    pub(super) members_at: u32,
    pub(super) incoming_at: u32,
    pub(super) windows_at: u32,
}

layout!(LevelParams: width, height, low, labels, quads, pitch, dependency_pitch, member_pitch, pixel_pitch, members_at, incoming_at, windows_at);

impl LevelParams {
    /// Parameters of `level`.
    pub(super) fn new(plan: &Plan, level: &LevelPlan) -> Self {
        const { assert!(LABEL_BLOCK.is_multiple_of(16)) };
        let quads = level.stride / 4;
        let pitch = |words: usize| words.next_multiple_of(ALIGN_WORDS) as u32;
        Self {
            width: level.width as u32,
            height: level.height as u32,
            low: level.min,
            labels: level.labels as u32,
            quads: quads as u32,
            pitch: pitch(level.width * quads),
            dependency_pitch: pitch(level.width * plan.slots() * quads),
            member_pitch: pitch(level.width * plan.neighbours.div_ceil(4)),
            pixel_pitch: pitch(level.width),
            ..Self::default()
        }
    }
}

/// `Band` of `shaders/shared/band.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub(super) struct Band {
    pub(super) first_row: u32,
    pub(super) rows: u32,
    pub(super) row_groups: u32,
    pub(super) grid: u32,
    pub(super) first_group: u32,
    pub(super) sections: u32,
    pub(super) volume_at: u32,
    pub(super) dependency_at: u32,
}

layout!(Band: first_row, rows, row_groups, grid, first_group, sections, volume_at, dependency_at);

/// The header of every uniform.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub(super) struct Header {
    pub(super) level: LevelParams,
    pub(super) band: Band,
}

layout!(Header: level, band);

/// The layout of a uniform, as a shader declares it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UniformLayout {
    /// Its fields with their offsets in bytes.
    pub fields: Vec<(&'static str, usize)>,
    /// Size of the uniform in bytes.
    pub bytes: usize,
}

impl UniformLayout {
    /// The layout of a header and `U`.
    pub(super) fn of<U: Layout>() -> Self {
        let own = U::FIELDS.iter().map(|(name, offset)| (*name, size_of::<Header>() + offset));
        let all = Header::FIELDS.iter().copied().chain(own);
        Self {
            fields: all.filter(|(name, _)| !name.starts_with("padding")).collect(),
            bytes: (size_of::<Header>() + size_of::<U>()).next_multiple_of(16),
        }
    }

    /// Layouts of the structs in the header: `Level` and `Band`.
    #[must_use]
    pub fn inner() -> [(&'static str, Self); 2] {
        fn of<T: Layout>() -> UniformLayout {
            UniformLayout { fields: T::FIELDS.to_vec(), bytes: size_of::<T>() }
        }
        [("Level", of::<LevelParams>()), ("Band", of::<Band>())]
    }
}

/// The bytes of a uniform.
pub(super) fn bytes<U: Layout>(header: &Header, own: &U) -> Vec<u8> {
    let mut bytes = [bytemuck::bytes_of(header), bytemuck::bytes_of(own)].concat();
    bytes.resize(bytes.len().next_multiple_of(16), 0);
    bytes
}
