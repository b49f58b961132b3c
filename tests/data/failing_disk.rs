//! A disk that fails, for the tests: a library for `LD_PRELOAD` (x86-64 Linux) that lets one
//! operation on the files of a folder fail. It is compiled by `tests/failing_disk.rs`.
//!
//! The kernel stops the program at each system call that creates, writes, flushes, cuts or
//! renames a file (a seccomp filter with `SECCOMP_RET_TRAP`), whatever library makes the call.
//! The handler of the signal counts the calls that concern files below the folder, fails the
//! chosen one, and makes all others itself.
//!
//! | variable | meaning |
//! |---|---|
//! | `FAILING_FOLDER` | absolute path of the folder |
//! | `FAILING_AT` | number of the operation that fails, from 1; 0 lets all succeed |
//! | `FAILING_HOW` | `once`: it alone fails (EIO); `full`: it writes half of what it should, and from then on nothing can be created or written (ENOSPC) |
//! | `FAILING_LOG` | file that gets a line for every operation |
//!
//! `OTHER_ROOT` names a folder whose files are read in place of those of the system that have
//! the same path below `/`; `/proc/self` in it stands for that of any process.

use std::arch::asm;
use std::ffi::{CStr, OsString, c_char, c_int, c_long, c_void};
use std::os::unix::ffi::OsStrExt;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering::SeqCst};

const WRITE: u64 = 1;
const PWRITE: u64 = 18;
const WRITEV: u64 = 20;
const FSYNC: u64 = 74;
const FDATASYNC: u64 = 75;
const FTRUNCATE: u64 = 77;
const ACCESS: u64 = 21;
const RENAME: u64 = 82;
const MKDIR: u64 = 83;
const READLINK: u64 = 89;
const OPENAT: u64 = 257;
const MKDIRAT: u64 = 258;
const RENAMEAT: u64 = 264;
const RENAMEAT2: u64 = 316;
const TRAPPED: [u64; 12] = [
    WRITE, PWRITE, WRITEV, FSYNC, FDATASYNC, FTRUNCATE, RENAME, MKDIR, OPENAT, MKDIRAT, RENAMEAT,
    RENAMEAT2,
];

const EIO: i64 = 5;
const ENOSPC: i64 = 28;
const O_CREAT: u64 = 0x40;

/// Sixth argument of the calls that the handler makes itself; the filter lets them pass. None
/// of these calls has a sixth argument.
const OWN: u32 = 0x0d15_c0de;

static FOLDER: [AtomicU64; 512] = [const { AtomicU64::new(0) }; 512];
static FOLDER_LENGTH: AtomicUsize = AtomicUsize::new(0);
static OTHER_ROOT: [AtomicU64; 512] = [const { AtomicU64::new(0) }; 512];
static OTHER_ROOT_LENGTH: AtomicUsize = AtomicUsize::new(0);
static AT: AtomicU64 = AtomicU64::new(0);
static IS_FULL: AtomicU64 = AtomicU64::new(0);
static LOG: AtomicU64 = AtomicU64::new(u64::MAX);
static COUNT: AtomicU64 = AtomicU64::new(0);

#[repr(C)]
struct Instruction {
    code: u16,
    if_true: u8,
    if_false: u8,
    k: u32,
}

#[repr(C)]
struct Program {
    length: u16,
    instructions: *const Instruction,
}

#[repr(C)]
struct Action {
    handler: extern "C" fn(c_int, *mut c_void, *mut c_void),
    mask: [u64; 16],
    flags: c_int,
    restorer: usize,
}

unsafe extern "C" {
    fn prctl(option: c_int, a: c_long, b: *const c_void, c: c_long, d: c_long) -> c_int;
    fn sigaction(signal: c_int, new: *const Action, old: *mut c_void) -> c_int;
}

/// Makes a system call that the filter lets pass; the error is negative.
fn call(number: u64, a: [u64; 5]) -> i64 {
    let result: i64;
    // SAFETY: the arguments are those of the program, or point to memory of the caller.
    unsafe {
        asm!("syscall", inlateout("rax") number as i64 => result,
            in("rdi") a[0], in("rsi") a[1], in("rdx") a[2], in("r10") a[3], in("r8") a[4],
            in("r9") u64::from(OWN), lateout("rcx") _, lateout("r11") _);
    }
    result
}

/// Whether a path lies in the folder.
fn is_inside(path: &[u8]) -> bool {
    let length = FOLDER_LENGTH.load(SeqCst);
    path.len() > length
        && path[..length]
            .iter()
            .zip(&FOLDER)
            .all(|(&a, b)| u64::from(a) == b.load(SeqCst))
}

/// The path of an open file.
fn path_of(file: u64, buffer: &mut [u8; 512]) -> &[u8] {
    let mut link = *b"/proc/self/fd/0000000000\0";
    let mut rest = file & 0xffff_ffff;
    for digit in link[14..24].iter_mut().rev() {
        *digit = b'0' + (rest % 10) as u8;
        rest /= 10;
    }
    // The names of /proc/self/fd have no leading zeros.
    let first = link[14..23].iter().position(|&d| d != b'0').unwrap_or(9);
    link.copy_within(14 + first..25, 14);
    let arguments = [link.as_ptr() as u64, buffer.as_mut_ptr() as u64, 512, 0, 0];
    let length = call(READLINK, arguments);
    &buffer[..usize::try_from(length).unwrap_or(0)]
}

fn append(line: &mut [u8; 640], at: &mut usize, words: &[u8]) {
    let room = words.len().min(line.len() - *at);
    line[*at..*at + room].copy_from_slice(&words[..room]);
    *at += room;
}

fn note(count: u64, fails: bool, what: &str, path: &[u8]) {
    let (mut line, mut at) = ([0u8; 640], 0);
    let mut digits = [b'0'; 6];
    let mut rest = count;
    for digit in digits.iter_mut().rev() {
        *digit = b'0' + (rest % 10) as u8;
        rest /= 10;
    }
    append(&mut line, &mut at, &digits);
    append(&mut line, &mut at, if fails { b" fails " } else { b" " });
    append(&mut line, &mut at, what.as_bytes());
    append(&mut line, &mut at, b" ");
    append(&mut line, &mut at, path);
    append(&mut line, &mut at, b"\n");
    call(
        WRITE,
        [LOG.load(SeqCst), line.as_ptr() as u64, at as u64, 0, 0],
    );
}

/// Opens the file of the other root in place of this one, if there is one.
fn opened_elsewhere(path: &[u8], a: [u64; 5]) -> Option<i64> {
    let length = OTHER_ROOT_LENGTH.load(SeqCst);
    if length == 0 || path.first() != Some(&b'/') {
        return None;
    }
    let process = path.strip_prefix(b"/proc/").and_then(|rest| {
        let digits = rest.iter().take_while(|d| d.is_ascii_digit()).count();
        (digits > 0).then(|| &rest[digits..])
    });
    let (start, rest): (&[u8], &[u8]) = match process {
        Some(rest) => (b"/proc/self", rest),
        None => (b"", path),
    };
    let mut place = [0u8; 1024];
    for (to, from) in place.iter_mut().zip(&OTHER_ROOT[..length]) {
        *to = from.load(SeqCst) as u8;
    }
    let end = length + start.len() + rest.len();
    if end + 2 >= place.len() {
        return None;
    }
    place[length..length + start.len()].copy_from_slice(start);
    place[length + start.len()..end].copy_from_slice(rest);
    let is_there = |place: &[u8; 1024]| call(ACCESS, [place.as_ptr() as u64, 0, 0, 0, 0]) == 0;
    let mut inside = place;
    inside[end..end + 2].copy_from_slice(b"/."); // which a folder alone has
    let is_file = is_there(&place) && !is_there(&inside);
    is_file.then(|| call(OPENAT, [a[0], place.as_ptr() as u64, a[2], a[3], a[4]]))
}

/// What the program gets of a call.
fn answer(number: u64, a: [u64; 5]) -> i64 {
    let mut buffer = [0; 512];
    let name = |pointer: u64| {
        // SAFETY: the call takes a path there.
        unsafe { CStr::from_ptr(pointer as *const c_char) }.to_bytes()
    };
    let path = match number {
        OPENAT if a[2] & O_CREAT == 0 => {
            return opened_elsewhere(name(a[1]), a).unwrap_or_else(|| call(number, a));
        }
        RENAME | MKDIR => name(a[0]),
        OPENAT | MKDIRAT | RENAMEAT | RENAMEAT2 => name(a[1]),
        _ => path_of(a[0], &mut buffer),
    };
    // A name without a root lies in the folder, where the program runs; what is no file is
    // shown as `pipe:[1]`.
    let is_name = matches!(
        number,
        OPENAT | RENAME | MKDIR | MKDIRAT | RENAMEAT | RENAMEAT2
    );
    if !is_inside(path) && !(is_name && path.first() != Some(&b'/')) {
        return call(number, a);
    }
    if matches!(number, MKDIR | MKDIRAT) && call(ACCESS, [path.as_ptr() as u64, 0, 0, 0, 0]) == 0 {
        return call(number, a); // it is there, which every disk says
    }
    let what = match number {
        WRITE | PWRITE | WRITEV => "write",
        FSYNC | FDATASYNC => "flush",
        FTRUNCATE => "cut",
        MKDIR | MKDIRAT => "make",
        OPENAT => "create",
        _ => "rename",
    };
    let (count, at) = (COUNT.fetch_add(1, SeqCst) + 1, AT.load(SeqCst));
    let is_full = IS_FULL.load(SeqCst) == 1 && at != 0 && count >= at;
    let fails = match is_full {
        true => matches!(what, "write" | "create" | "make"),
        false => count == at,
    };
    note(count, fails, what, path);
    match fails {
        true if is_full && count == at && number == WRITE && a[2] > 1 => {
            call(number, [a[0], a[1], a[2] / 2, a[3], a[4]])
        }
        true if is_full => -ENOSPC,
        true => -EIO,
        false => call(number, a),
    }
}

/// Registers of a signal's context: their places in `ucontext_t`, in words of 8 bytes.
const REGISTERS: usize = 5;
const ARGUMENTS: [usize; 5] = [8, 9, 12, 2, 0]; // RDI, RSI, RDX, R10, R8
const RAX: usize = 13;

extern "C" fn on_call(_: c_int, _: *mut c_void, context: *mut c_void) {
    let register = |i: usize| unsafe { context.cast::<u64>().add(REGISTERS + i) };
    // SAFETY: the kernel passes the context of the call, with its number in RAX.
    unsafe {
        let arguments = ARGUMENTS.map(|i| register(i).read());
        let result = answer(register(RAX).read(), arguments);
        register(RAX).write(result as u64);
    }
}

extern "C" fn start() {
    let variable = |name: &str| std::env::var_os(name).unwrap_or_default();
    let keep = |path: OsString, places: &[AtomicU64], length: &AtomicUsize| {
        for (place, &byte) in places.iter().zip(path.as_bytes()) {
            place.store(u64::from(byte), SeqCst);
        }
        length.store(path.len().min(places.len()), SeqCst);
    };
    keep(variable("FAILING_FOLDER"), &FOLDER, &FOLDER_LENGTH);
    keep(variable("OTHER_ROOT"), &OTHER_ROOT, &OTHER_ROOT_LENGTH);
    let at = variable("FAILING_AT");
    AT.store(at.to_string_lossy().parse().unwrap_or(0), SeqCst);
    IS_FULL.store(u64::from(variable("FAILING_HOW") == "full"), SeqCst);
    let log = std::fs::OpenOptions::new()
        .create(true)
        .append(true)
        .open(variable("FAILING_LOG"));
    use std::os::fd::IntoRawFd;
    LOG.store(
        log.map_or(u64::MAX, |file| file.into_raw_fd() as u64),
        SeqCst,
    );
    let action = Action {
        handler: on_call,
        mask: [0; 16],
        flags: 4 | 0x4000_0000,
        restorer: 0,
    };
    // The filter: the number is at 0, the low half of the sixth argument at 56.
    let load = |k| Instruction {
        code: 0x20,
        if_true: 0,
        if_false: 0,
        k,
    };
    let end = |k| Instruction {
        code: 0x06,
        if_true: 0,
        if_false: 0,
        k,
    };
    let count = TRAPPED.len();
    let mut filter = vec![load(0)];
    for (i, &number) in TRAPPED.iter().enumerate() {
        let if_true = (count - i) as u8;
        filter.push(Instruction {
            code: 0x15,
            if_true,
            if_false: 0,
            k: number as u32,
        });
    }
    filter.push(end(0x7fff_0000)); // allow
    filter.push(load(56));
    filter.push(Instruction {
        code: 0x15,
        if_true: 0,
        if_false: 1,
        k: OWN,
    });
    filter.push(end(0x7fff_0000));
    filter.push(end(0x0003_0000)); // trap
    let program = Program {
        length: filter.len() as u16,
        instructions: filter.as_ptr(),
    };
    // SAFETY: the structures are those of the kernel and the C library on x86-64 Linux.
    unsafe {
        sigaction(31, (&raw const action).cast(), std::ptr::null_mut());
        prctl(38, 1, std::ptr::null(), 0, 0);
        prctl(22, 2, (&raw const program).cast(), 0, 0);
    }
}

#[used]
#[unsafe(link_section = ".init_array")]
static START: extern "C" fn() = start;
