//! Memory of the machine and of the process, where the system tells.

/// Bytes of memory and swap of the machine.
pub(super) fn of_machine() -> Option<u64> {
    let all = std::fs::read_to_string("/proc/meminfo").ok()?;
    Some(value(&all, "MemTotal:")? + value(&all, "SwapTotal:").unwrap_or(0))
}

/// Bytes of the process that are in memory.
#[must_use]
pub fn resident() -> Option<u64> {
    of_process("VmRSS:")
}

/// The most that there ever were.
#[must_use]
pub fn peak() -> Option<u64> {
    of_process("VmHWM:")
}

fn of_process(name: &str) -> Option<u64> {
    value(&std::fs::read_to_string("/proc/self/status").ok()?, name)
}

/// Bytes, of a table of lines like `VmRSS:  1234 kB`.
fn value(table: &str, name: &str) -> Option<u64> {
    let line = table.lines().find_map(|line| line.strip_prefix(name))?;
    Some(line.trim().trim_end_matches("kB").trim().parse::<u64>().ok()? * 1024)
}
