//! Choosing the copy of a function's loops that is compiled for an instruction set.

/// Runs the copy of a function's loops that is compiled for an instruction set.
///
/// `dispatch!(simd, loops(argument: Type, …))` calls the generic `loops::<V>` with the registers `V` of the set,
/// `dispatch!(simd, plain loops(…))` a function of plain Rust. They are `inline(always)`, so each copy is compiled with the
/// instructions that its caller here enables.
macro_rules! dispatch {
    ($simd:expr, plain $loops:ident($($argument:ident: $type:ty),* $(,)?)) => {
        dispatch!(
            @ $simd,
            ($($argument: $type),*),
            $loops($($argument),*),
            $loops($($argument),*),
            $loops($($argument),*)
        )
    };
    ($simd:expr, $loops:ident($($argument:ident: $type:ty),* $(,)?)) => {
        // SAFETY: the function that runs it enables the instruction set, and the caller has checked the arguments.
        dispatch!(
            @ $simd,
            ($($argument: $type),*),
            unsafe { $loops::<$crate::domain::unet::ops::lanes::Avx512>($($argument),*) },
            unsafe { $loops::<$crate::domain::unet::ops::lanes::Avx2>($($argument),*) },
            unsafe { $loops::<$crate::domain::unet::ops::lanes::Portable>($($argument),*) }
        )
    };
    (@ $simd:expr, ($($argument:ident: $type:ty),*), $avx512:expr, $avx2:expr, $portable:expr) => {{
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx512f,avx2,fma")]
        fn avx512($($argument: $type),*) {
            $avx512;
        }
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2,fma")]
        fn avx2($($argument: $type),*) {
            $avx2;
        }
        let simd: $crate::domain::unet::compute::Simd = $simd;
        assert!(simd.is_available(), "the processor has the instruction set");
        match simd {
            // SAFETY: the processor has the instruction set.
            #[cfg(target_arch = "x86_64")]
            $crate::domain::unet::compute::Simd::Avx512 => unsafe { avx512($($argument),*) },
            // SAFETY: the processor has the instruction set.
            #[cfg(target_arch = "x86_64")]
            $crate::domain::unet::compute::Simd::Avx2 => unsafe { avx2($($argument),*) },
            _ => $portable,
        }
    }};
}
pub(super) use dispatch;
