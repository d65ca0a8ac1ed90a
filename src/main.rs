//! The `abbe` command.

fn main() {
    std::process::exit(abbe::cli::run());
}
