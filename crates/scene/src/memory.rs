//! Memory: what this process may still take.

use sysinfo::{MemoryRefreshKind, Pid, ProcessRefreshKind, ProcessesToUpdate, System};

/// Memory that this process may still take: the least of what the machine has available,
/// what its control group (version 1 or 2) leaves and what its limit of the address space
/// leaves; no limit where the system reports none of them.
pub fn free_memory_bytes() -> u64 {
    let Ok(mut system) = System::new() else {
        return address_space_bytes().unwrap_or(u64::MAX);
    };
    system.refresh_memory_specifics(MemoryRefreshKind::nothing().with_ram());
    let machine = (system.total_memory() > 0).then(|| system.available_memory());
    let own = Pid::from_u32(std::process::id());
    system.refresh_processes_specifics(
        ProcessesToUpdate::Some(&[own]),
        false,
        ProcessRefreshKind::nothing().with_memory(),
    );
    let process = system.process(own);
    let group = process.and_then(|p| p.cgroup_limits()).map(|limits| {
        // The cache of files is given back when memory is short, so that only memory
        // without files is counted as taken.
        limits.total_memory.saturating_sub(limits.rss)
    });
    let taken = process.map_or(0, |p| p.virtual_memory());
    let address_space = address_space_bytes().map(|limit| limit.saturating_sub(taken));
    let limits = [machine, group, address_space];
    limits.into_iter().flatten().min().unwrap_or(u64::MAX)
}

/// Memory that this process has taken, where the system reports it.
pub fn resident_memory_bytes() -> Option<u64> {
    let mut system = System::new().ok()?;
    let own = Pid::from_u32(std::process::id());
    system.refresh_processes_specifics(
        ProcessesToUpdate::Some(&[own]),
        false,
        ProcessRefreshKind::nothing().with_memory(),
    );
    system.process(own).map(|process| process.memory())
}

/// The limit of the address space (`RLIMIT_AS`, `ulimit -v`), if there is one.
fn address_space_bytes() -> Option<u64> {
    #[cfg(target_os = "linux")]
    {
        use nix::sys::resource::{RLIM_INFINITY, Resource, getrlimit};
        let (soft, _) = getrlimit(Resource::RLIMIT_AS).ok()?;
        (soft != RLIM_INFINITY).then_some(soft)
    }
    #[cfg(not(target_os = "linux"))]
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn some_memory_is_free_and_no_more_than_the_machine_has() {
        let mut system = System::new().unwrap();
        system.refresh_memory();
        let free = free_memory_bytes();
        assert!(free > 1 << 20, "{free}");
        assert!(free <= system.total_memory(), "{free}");
        let taken = resident_memory_bytes().unwrap();
        assert!(taken > 1 << 16 && taken < system.total_memory(), "{taken}");
    }
}
