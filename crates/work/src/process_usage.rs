//! Time and memory that this process has used.

/// Seconds that processors spent on all threads of the process: unlike the
/// clock's, they do not count what other programs took. The clock's where the
/// system does not tell.
pub fn cpu_seconds() -> f64 {
    #[cfg(unix)]
    {
        use nix::sys::resource::{UsageWho, getrusage};
        use nix::sys::time::TimeValLike;
        if let Ok(usage) = getrusage(UsageWho::RUSAGE_SELF) {
            let spent = usage.user_time() + usage.system_time();
            return spent.num_microseconds() as f64 * 1e-6;
        }
    }
    use std::sync::OnceLock;
    use std::time::Instant;
    static FIRST: OnceLock<Instant> = OnceLock::new();
    FIRST.get_or_init(Instant::now).elapsed().as_secs_f64()
}

/// Peak memory of the process, where the system reports it (Linux does).
///
/// Read by hand: `getrusage` counts what the parent had when it started the process, which
/// in renders of `organza bench` is the bench's own memory, and `sysinfo` reports no peak.
pub fn peak_memory_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kib.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_is_counted() {
        let before = cpu_seconds();
        let busy = std::time::Instant::now();
        let mut x = 1u64;
        while busy.elapsed().as_millis() < 30 {
            x = std::hint::black_box(x.wrapping_mul(6_364_136_223_846_793_005));
        }
        let spent = cpu_seconds() - before;
        assert!(spent > 0.0 && spent.is_finite(), "{spent}");
        assert!(peak_memory_bytes().is_none_or(|bytes| bytes > 1 << 16));
    }
}
