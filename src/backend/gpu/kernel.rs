//! Kernels: the entry points of the shaders, each declared once, with what it binds by the names of its shader.

use super::rows::Binding;
use super::shader::{Constant, Shader};
use super::uniform::{Layout, UniformLayout};
use crate::plan::{Plan, VolumeWidth};
use std::marker::PhantomData;

/// Largest total number of loop iterations of one invocation.
pub const MAX_LOOP_ITERATIONS: usize = 32_768;

/// Declares the shader of a stage: its own uniform, and a row for each entry point:
/// `ENTRY: BINDINGS { NAMES } => KERNEL;`. The names are those of the shader. `ENTRY(plan, level)` gives the
/// kernel, and `kernels(plan, level)` lists all, but for those whose row has a condition that does not hold
/// (`if ...` before the `=>`).
macro_rules! shader {
    (
        $stage:literal($plan:ident, $level:ident) { $( $field:ident: $type:ty ),* $(,)? }
        $(
            $entry:ident: $bindings:ident { $( $name:ident ),+ $(,)? }
            $( if $condition:expr )? => $kernel:expr;
        )+
    ) => {
        $crate::backend::gpu::uniform::layout!(Uniform { $( $field: $type ),* });

        $(
            pub(super) struct $bindings {
                $( $name: $crate::backend::gpu::rows::Binding, )+
            }

            impl $crate::backend::gpu::kernel::Bindings for $bindings {
                type Uniform = Uniform;
                const SHADER: $crate::backend::gpu::Shader = $crate::backend::gpu::Shader::new(
                    $stage,
                    stringify!($entry),
                    include_str!(concat!("../../../shaders/", $stage, ".wgsl")),
                );
                const NAMES: &'static [&'static str] = &[$( stringify!($name) ),+];

                fn all(self) -> Vec<$crate::backend::gpu::rows::Binding> {
                    vec![$( self.$name ),+]
                }
            }

            #[allow(unused_variables, reason = "not every kernel depends on both")]
            fn $entry($plan: &$crate::plan::Plan, $level: usize) -> $crate::backend::gpu::Kernel<$bindings> {
                $kernel
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

/// What a kernel binds beside its uniform.
pub(super) trait Bindings {
    /// The stage's own uniform.
    type Uniform: Layout;
    /// The entry point.
    const SHADER: Shader;
    /// The names in the shader.
    const NAMES: &'static [&'static str];

    /// What is bound, in the order of the names.
    fn all(self) -> Vec<Binding>;
}

/// A kernel as a plan specialises it, before there is a device; `B` is what it binds, or any.
#[derive(Clone, Debug)]
pub struct Kernel<B = ()> {
    /// The entry point and its constants.
    pub shader: Shader,
    /// Largest total number of loop iterations of one invocation. Mesa 22 stops a shader silently after about
    /// 65,000.
    pub loops: usize,
    /// The uniform that it reads: one, or an array of one for each of so many levels.
    pub uniform: UniformLayout,
    /// What it binds beside the uniform.
    pub names: &'static [&'static str],
    pub(super) sections: usize,
    bindings: PhantomData<fn(B)>,
}

#[allow(private_bounds, reason = "outside, a kernel binds any")]
impl<B: Bindings> Kernel<B> {
    /// The kernel of these bindings, which takes at most `loops` loop iterations.
    pub(super) fn new(loops: usize) -> Self {
        Self::of(B::SHADER, loops)
    }

    /// The same in the `shader` of another stage.
    pub(super) fn of(shader: Shader, loops: usize) -> Self {
        let uniform = UniformLayout::of::<B::Uniform>();
        Self { shader, loops, uniform, names: B::NAMES, sections: 1, bindings: PhantomData }
    }

    /// The same for messages and beliefs of this width.
    pub(super) fn of_width(mut self, width: VolumeWidth) -> Self {
        self.shader.width = Some(width);
        self
    }

    /// The same with one more constant.
    pub(super) fn with(mut self, name: &'static str, value: impl Into<Constant>) -> Self {
        self.shader.constants.push((name, value.into()));
        self
    }

    /// The same for a kernel that may go over as many levels at once as `plan` has.
    pub(super) fn over_levels(self, plan: &Plan) -> Self {
        let sections = plan.levels.len();
        Self { sections, ..self.with("SECTIONS", sections as u32) }
    }

    /// The same among others.
    pub(super) fn any(&self) -> Kernel {
        let &Self { ref shader, loops, ref uniform, names, sections, .. } = self;
        let (shader, uniform) = (shader.clone(), uniform.clone());
        Kernel { shader, loops, uniform, names, sections, bindings: PhantomData }
    }
}
