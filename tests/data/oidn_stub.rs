//! A library with the C interface of Open Image Denoise 2 as far as organza calls it, for
//! tests: it does not denoise. Its result holds the red of the colours, the green of the albedo
//! and the blue of the normal, each half as large if the filter was asked for clean guides;
//! a filter of one picture returns that picture. Pictures one pixel wide are an error.
#![allow(non_snake_case)]
use std::ffi::{CStr, c_char, c_int, c_void};

struct Device {
    error: Option<&'static CStr>,
}

struct Filter {
    device: *mut Device,
    images: Vec<(String, *mut f32, usize, usize)>,
    flags: Vec<String>,
}

unsafe fn name(text: *const c_char) -> String {
    unsafe { CStr::from_ptr(text) }.to_str().unwrap().to_owned()
}

#[unsafe(no_mangle)]
extern "C" fn oidnNewDevice(kind: c_int) -> *mut Device {
    assert_eq!(kind, 1, "the processor");
    Box::into_raw(Box::new(Device { error: None }))
}
#[unsafe(no_mangle)]
extern "C" fn oidnCommitDevice(_: *mut Device) {}
#[unsafe(no_mangle)]
unsafe extern "C" fn oidnReleaseDevice(device: *mut Device) {
    drop(unsafe { Box::from_raw(device) });
}
#[unsafe(no_mangle)]
unsafe extern "C" fn oidnGetDeviceInt(_: *mut Device, text: *const c_char) -> c_int {
    assert_eq!(unsafe { name(text) }, "version");
    option_env!("STUB_VERSION").map_or(20304, |v| v.parse().unwrap())
}
#[unsafe(no_mangle)]
extern "C" fn oidnSetDeviceInt(_: *mut Device, _: *const c_char, _: c_int) {}
#[unsafe(no_mangle)]
extern "C" fn oidnSetDeviceBool(_: *mut Device, _: *const c_char, _: bool) {}
#[unsafe(no_mangle)]
unsafe extern "C" fn oidnGetDeviceError(device: *mut Device, text: *mut *const c_char) -> c_int {
    match unsafe { (*device).error.take() } {
        Some(message) => {
            unsafe { *text = message.as_ptr() };
            2
        }
        None => 0,
    }
}
#[unsafe(no_mangle)]
unsafe extern "C" fn oidnNewFilter(device: *mut Device, kind: *const c_char) -> *mut Filter {
    assert_eq!(unsafe { name(kind) }, "RT");
    Box::into_raw(Box::new(Filter { device, images: Vec::new(), flags: Vec::new() }))
}
#[unsafe(no_mangle)]
unsafe extern "C" fn oidnReleaseFilter(filter: *mut Filter) {
    drop(unsafe { Box::from_raw(filter) });
}
#[unsafe(no_mangle)]
unsafe extern "C" fn oidnSetSharedFilterImage(
    filter: *mut Filter,
    text: *const c_char,
    start: *mut c_void,
    format: c_int,
    width: usize,
    height: usize,
    offset: usize,
    pixel_stride: usize,
    row_stride: usize,
) {
    assert_eq!((format, offset, pixel_stride, row_stride), (3, 0, 0, 0));
    let image = (unsafe { name(text) }, start.cast(), width, height);
    unsafe { (*filter).images.push(image) };
}
#[unsafe(no_mangle)]
unsafe extern "C" fn oidnSetFilterBool(filter: *mut Filter, text: *const c_char, value: bool) {
    assert!(value);
    unsafe { (*filter).flags.push(name(text)) };
}
#[unsafe(no_mangle)]
extern "C" fn oidnSetFilterInt(_: *mut Filter, _: *const c_char, _: c_int) {}
#[unsafe(no_mangle)]
extern "C" fn oidnCommitFilter(_: *mut Filter) {}
#[unsafe(no_mangle)]
unsafe extern "C" fn oidnExecuteFilter(filter: *mut Filter) {
    let filter = unsafe { &mut *filter };
    let find = |wanted: &str| filter.images.iter().find(|image| image.0 == wanted);
    let &(_, output, width, height) = find("output").unwrap();
    if width == 1 {
        unsafe { (*filter.device).error = Some(c"too narrow") };
        return;
    }
    let scale = if filter.flags.iter().any(|flag| flag == "cleanAux") { 0.5 } else { 1.0 };
    let inputs = filter.images.len() - 1;
    for i in 0..3 * width * height {
        let of = ["color", "albedo", "normal"].map(find);
        let chosen = match inputs {
            1 => of.into_iter().flatten().next(),
            _ => of[i % 3],
        };
        let &(_, start, w, h) = chosen.unwrap();
        assert_eq!((w, h), (width, height));
        unsafe { *output.add(i) = *start.add(i) * scale };
    }
}
