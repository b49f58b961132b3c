//! Ctrl-C, SIGTERM and SIGHUP: the first asks for a stop in order, the second ends the program at
//! once.

use organza_work::StopFlag;
use std::sync::{LazyLock, Once};

/// What an interrupt asks.
static FLAG: LazyLock<StopFlag> = LazyLock::new(StopFlag::default);

/// Exit status of a program that a second Ctrl-C ended, as shells have it.
const INTERRUPTED: i32 = 130;

/// The flag that an interrupt sets once the program [watches](watch).
pub fn flag() -> StopFlag {
    FLAG.clone()
}

/// From now on an interrupt asks for a stop instead of ending the program. Where the system does not
/// allow it, interrupts end the program as before.
pub fn watch() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let _ = ctrlc::set_handler(|| {
            if FLAG.ask_again() {
                std::process::exit(INTERRUPTED);
            }
        });
    });
}

/// True once the user has asked to stop.
pub fn came() -> bool {
    FLAG.is_asked()
}
