//! Memory of the machine.

/// Memory that the machine has free, where it reports that (Linux does); else no limit.
pub fn free_memory_bytes() -> u64 {
    let from_kernel = || {
        let text = std::fs::read_to_string("/proc/meminfo").ok()?;
        let line = text.lines().find_map(|l| l.strip_prefix("MemAvailable:"))?;
        let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
        kib.checked_mul(1024)
    };
    from_kernel().unwrap_or(u64::MAX)
}
