//! The parameters of a kernel: one uniform buffer per dispatch. All start with the same header; the rest
//! depends on the stage.

use crate::plan::{LABEL_BLOCK, LevelPlan, Plan, ROW_ALIGN};
use bytemuck::Pod;

/// Rows of every buffer start at a multiple of this many 32-bit words.
pub(super) const ALIGN_WORDS: usize = ROW_ALIGN / 4;

/// Declares a struct that a shader reads, with the names and offsets of its fields for tests that compare both.
macro_rules! layout {
    ($(#[$about:meta])* $name:ident { $( $field:ident: $type:ty ),* $(,)? }) => {
        $(#[$about])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
        pub(super) struct $name {
            $( pub(super) $field: $type, )*
        }

        impl $crate::backend::gpu::uniform::Layout for $name {
            const FIELDS: &'static [(&'static str, usize)] =
                &[$( (stringify!($field), std::mem::offset_of!($name, $field)), )*];
        }
    };
}

pub(super) use layout;

/// A struct with names and byte offsets of its fields.
pub(super) trait Layout: Pod {
    /// Every field.
    const FIELDS: &'static [(&'static str, usize)];
}

layout! {
    /// `Level` of `shaders/shared/band.wgsl`.
    LevelParams {
        width: u32,
        height: u32,
        low: i32,
        labels: u32,
        quads: u32,
        pitch: u32,
        dependency_pitch: u32,
        member_pitch: u32,
        pixel_pitch: u32,
        members_at: u32,
        incoming_at: u32,
        windows_at: u32,
    }
}

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

/// Elements per row of a map at full size.
pub(super) fn full_pitch(plan: &Plan) -> u32 {
    (2 * plan.levels[0].width).next_multiple_of(ALIGN_WORDS) as u32
}

layout! {
    /// `Band` of `shaders/shared/band.wgsl`.
    Band {
        first_row: u32,
        rows: u32,
        row_groups: u32,
        grid: u32,
        first_group: u32,
        sections: u32,
        volume_at: u32,
        dependency_at: u32,
    }
}

layout! {
    /// The header of every uniform.
    Header {
        level: LevelParams,
        band: Band,
    }
}

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
        Self { fields: all.collect(), bytes: (size_of::<Header>() + size_of::<U>()).next_multiple_of(16) }
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

/// The bytes of a uniform with this header and the stage's `own` bytes.
pub(super) fn bytes(header: &Header, own: &[u8]) -> Vec<u8> {
    let mut bytes = [bytemuck::bytes_of(header), own].concat();
    bytes.resize(bytes.len().next_multiple_of(16), 0);
    bytes
}
