//! Nothing, in place of the crate of this name on crates.io.
//!
//! iceoryx2 0.10 names bindgen as a build dependency of `iceoryx2-pal-posix` and `iceoryx2-pal-os-api`. The build script
//! of the first calls it where the compiler itself runs on QNX, and the second has no build script. Cargo would compile
//! it and eleven crates that nothing else needs, a thirtieth of the first build.
