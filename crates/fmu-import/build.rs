//! Compiles the logger callback: a C variadic function, which stable Rust can call but not define.

fn main() {
    println!("cargo::rerun-if-changed=src/logger.c");
    cc::Build::new().file("src/logger.c").warnings_into_errors(true).compile("master_logger");
}
