//! Kernels: the entry points of the shaders, each declared once, with its bindings.

use super::shader::{Constant, Shader};
use super::uniform::{Layout, UniformLayout};
use crate::plan::{Plan, VolumeWidth};
use crate::stage::Extent;
use std::marker::PhantomData;

/// Largest total number of loop iterations of one invocation.
pub const MAX_LOOP_ITERATIONS: usize = 32_768;

/// Declares the shader of a stage: its own uniform, and a row for each entry point: `ENTRY { NAME, NAME as DATA, NAME around ROWS } => VARIANT;`. A
/// name is a binding in the shader. It selects the data (see [`Data::bound`](crate::stage::Data::bound)) unless `as` does, with `around` extra rows
/// on either side. `ENTRY(plan, level)` returns the kernel, and `kernels(plan, level)` all those whose condition (`if ...` before the `=>`) holds.
macro_rules! shader {
    (
        $stage:literal($plan:ident, $level:ident) { $( $field:ident: $type:ty ),* $(,)? }
        $(
            $entry:ident { $( $name:ident $( as $data:ident )? $( around $reach:expr )? ),+ $(,)? }
            $( if $condition:expr )? => $variant:expr;
        )+
    ) => {
        $crate::backend::gpu::uniform::layout!(Uniform { $( $field: $type ),* });

        $(
            #[allow(unused_variables, reason = "not every kernel depends on both")]
            pub(super) fn $entry(
                $plan: &$crate::plan::Plan,
                $level: usize,
            ) -> $crate::backend::gpu::Kernel<Uniform> {
                let shader = $crate::backend::gpu::Shader::new(
                    $stage,
                    stringify!($entry),
                    include_str!(concat!("../../../../shaders/", $stage, ".wgsl")),
                );
                let bound = vec![$( (stringify!($name), 0 $( + ($reach) as u32 )?) ),+];
                let kernel = $crate::backend::gpu::Kernel::new(shader, bound, $variant);
                $( $( let kernel = kernel.taking(stringify!($name), stringify!($data)); )? )+
                kernel
            }
        )+

        #[allow(unused_variables, reason = "not every condition depends on both")]
        pub(super) fn kernels(
            $plan: &$crate::plan::Plan,
            $level: usize,
        ) -> Vec<$crate::backend::gpu::Kernel> {
            let mut kernels = Vec::new();
            $( if true $( && $condition )? { kernels.push($entry($plan, $level).any()); } )+
            kernels
        }
    };
}

pub(super) use shader;

/// The specialization of a kernel for a plan.
#[derive(Clone, Debug)]
pub(super) struct Variant {
    loops: usize,
    width: Option<VolumeWidth>,
    constants: Vec<(&'static str, Constant)>,
    sections: usize,
    extent: Option<Extent>,
    coarser: bool,
}

impl Variant {
    /// With at most `loops` loop iterations per invocation, and no constants.
    pub(super) fn new(loops: usize) -> Self {
        Self { loops, width: None, constants: Vec::new(), sections: 1, extent: None, coarser: false }
    }

    /// Sets the width of messages and beliefs.
    pub(super) fn of_width(self, width: VolumeWidth) -> Self {
        Self { width: Some(width), ..self }
    }

    /// Adds a constant.
    pub(super) fn with(mut self, name: &'static str, value: impl Into<Constant>) -> Self {
        self.constants.push((name, value.into()));
        self
    }

    /// Allows one dispatch to process all levels of `plan`.
    pub(super) fn over_levels(self, plan: &Plan) -> Self {
        let sections = plan.levels.len();
        Self { sections, ..self.with("SECTIONS", sections as u32) }
    }

    /// Runs over rows of this extent instead of those of its level.
    pub(super) fn over(self, extent: Extent) -> Self {
        Self { extent: Some(extent), ..self }
    }

    /// Runs at the next coarser level than its stage.
    pub(super) fn at_coarser_level(self) -> Self {
        Self { coarser: true, ..self }
    }
}

/// A specialized kernel, before it is compiled for a device; `U` is the uniform of its stage, or erased.
#[derive(Clone, Debug)]
pub struct Kernel<U = ()> {
    /// The entry point and its constants.
    pub shader: Shader,
    /// Upper bound of the loop iterations of one invocation. Mesa 22 stops a shader silently after about
    /// 65,000.
    pub loops: usize,
    /// The layout of its uniform: one, or an array with one for each level.
    pub uniform: UniformLayout,
    /// The bindings besides the uniform.
    pub bound: Vec<Bound>,
    /// Whether it runs at the next coarser level than its stage.
    pub coarser: bool,
    pub(super) sections: usize,
    pub(super) extent: Option<Extent>,
    own: PhantomData<fn(U)>,
}

/// An array that a kernel binds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bound {
    /// Its name in the shader.
    pub name: &'static str,
    /// The name of its data, which may differ.
    pub data: &'static str,
    /// Extra rows that the kernel reads on either side of those that it runs over.
    pub around: u32,
}

#[allow(private_bounds, reason = "outside, a kernel has any uniform")]
impl<U: Layout> Kernel<U> {
    /// The kernel of an entry point; `bound` gives names and extra rows on either side.
    pub(super) fn new(mut shader: Shader, bound: Vec<(&'static str, u32)>, variant: Variant) -> Self {
        let Variant { loops, width, constants, sections, extent, coarser } = variant;
        (shader.width, shader.constants) = (width, constants);
        let bound = bound.into_iter().map(|(name, around)| Bound { name, data: name, around }).collect();
        let uniform = UniformLayout::of::<U>();
        Self { shader, loops, uniform, bound, coarser, sections, extent, own: PhantomData }
    }

    /// Sets the data of the binding `name`.
    pub(super) fn taking(mut self, name: &str, data: &'static str) -> Self {
        for bound in self.bound.iter_mut().filter(|bound| bound.name == name) {
            bound.data = data;
        }
        self
    }

    /// Erases the type of the uniform, so that kernels of different stages can be kept in one list.
    pub(super) fn any(&self) -> Kernel {
        let &Self { ref shader, loops, ref uniform, ref bound, coarser, sections, extent, .. } = self;
        let (shader, uniform, bound) = (shader.clone(), uniform.clone(), bound.clone());
        Kernel { shader, loops, uniform, bound, coarser, sections, extent, own: PhantomData }
    }
}
