//! The `abbe` command.

#[cfg(all(target_os = "linux", target_env = "gnu", target_pointer_width = "64"))]
mod memory;

#[cfg(all(target_os = "linux", target_env = "gnu", target_pointer_width = "64"))]
#[global_allocator]
static ALLOCATOR: memory::LargePages = memory::LargePages;

fn main() {
    #[cfg(all(target_os = "linux", target_env = "gnu", target_pointer_width = "64"))]
    {
        memory::keep_large_blocks_apart();
        memory::end_in_words(abbe::error::Error::Memory(String::new()).exit_code());
    }
    std::process::exit(abbe::cli::run());
}
