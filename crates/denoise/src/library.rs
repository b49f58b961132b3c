//! The library, loaded while the program runs. This is the one file of the crate with `unsafe`.
//!
//! # Why it is sound
//! - **Loading** runs the code of a library that the user installed or named: it is trusted as
//!   the program itself is. It is never unloaded, since its threads may outlive the last call.
//! - **Signatures.** The functions are those of the C interface of versions 1 and 2, which
//!   agree in all that is called here but for the names of three of them ([`Functions`]); the
//!   version is asked for and checked before any picture is passed. Handles are opaque
//!   pointers, and all text that is passed is a [`CStr`] constant.
//! - **Handles** are checked for null when they are made. [`Device`] and [`Filter`] release
//!   them once, when dropped, the filter before its device, which it borrows.
//! - **Pictures** are slices of `[f32; 3]`, as many as width times height, which is checked:
//!   `FLOAT3` without strides has exactly this layout. [`Filter`] borrows them for its own
//!   lifetime, the output mutably, and a filter runs in the calling thread until it is done.
//!   The library does not write to the inputs.
//! - **Messages** point into the library until the next error; they are copied at once.
#![allow(unsafe_code)]

use crate::Guides;
use crate::places::needed_beside;
use glam::UVec2;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::marker::PhantomData;
use std::mem::ManuallyDrop;
use std::path::Path;

/// Processors: graphics cards give other results on other computers.
const DEVICE_CPU: c_int = 1;

/// Three floats a pixel.
const FLOAT3: c_int = 3;

/// Why a picture keeps its noise.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DenoiseError {
    /// The file is not the library, or one that does not work here.
    #[error("{0}")]
    Unusable(String),
    /// The library reported this.
    #[error("Open Image Denoise: {0}")]
    Failed(String),
    /// A picture has another number of pixels than the others.
    #[error("the pictures are not of one size")]
    Size,
}

/// How to denoise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Threads to use; all cores if none.
    pub threads: Option<u16>,
    /// Memory that the library may use for its own, about, bytes.
    pub max_memory_bytes: u64,
}

type Handle = *mut c_void;
type NewDevice = unsafe extern "C" fn(c_int) -> Handle;
type OfHandle = unsafe extern "C" fn(Handle);
type GetInt = unsafe extern "C" fn(Handle, *const c_char) -> c_int;
type SetInt = unsafe extern "C" fn(Handle, *const c_char, c_int);
type SetBool = unsafe extern "C" fn(Handle, *const c_char, bool);
type GetError = unsafe extern "C" fn(Handle, *mut *const c_char) -> c_int;
type NewFilter = unsafe extern "C" fn(Handle, *const c_char) -> Handle;
type SetImage =
    unsafe extern "C" fn(Handle, *const c_char, Handle, c_int, usize, usize, usize, usize, usize);

/// The functions that are called. Where two names stand, the second is that of version 1.
struct Functions {
    new_device: NewDevice,
    commit_device: OfHandle,
    release_device: OfHandle,
    get_device_int: GetInt,
    set_device_int: SetInt,
    set_device_bool: SetBool,
    get_device_error: GetError,
    new_filter: NewFilter,
    set_image: SetImage,
    set_filter_bool: SetBool,
    set_filter_int: SetInt,
    commit_filter: OfHandle,
    execute_filter: OfHandle,
    release_filter: OfHandle,
}

/// Open Image Denoise.
pub struct Library {
    functions: Functions,
    version: [u32; 3],
    /// Kept to the end of the process.
    _loaded: ManuallyDrop<libloading::Library>,
}

impl Library {
    /// Loads the library of a path, or of a name that the system looks for.
    ///
    /// # Errors
    /// It cannot be loaded, lacks a function, or has a version other than 1 and 2.
    pub fn open(path: &Path) -> Result<Library, DenoiseError> {
        let unusable = |e: libloading::Error| DenoiseError::Unusable(e.to_string());
        for needed in needed_beside(path) {
            // It may be found by itself; if not, the library reports it.
            let _ = load_for_all(&needed).map(std::mem::forget);
        }
        // SAFETY: see "Loading" above.
        let loaded = unsafe { libloading::Library::new(path) }.map_err(unusable)?;
        let loaded = ManuallyDrop::new(loaded);
        let functions = Functions::of(&loaded).map_err(unusable)?;
        let mut library = Library {
            functions,
            version: [0; 3],
            _loaded: loaded,
        };
        let device = Device::new(&library.functions)?;
        let number = device.get_int(c"version");
        drop(device);
        let number = u32::try_from(number).unwrap_or(0);
        library.version = [number / 10_000, number / 100 % 100, number % 100];
        match library.version[0] {
            1 | 2 => Ok(library),
            _ => Err(DenoiseError::Unusable(format!(
                "has version {}; expected 1 or 2",
                library.version()
            ))),
        }
    }

    /// Its version, such as 2.5.1.
    pub fn version(&self) -> String {
        self.version.map(|n| n.to_string()).join(".")
    }

    /// A picture without its noise: linear radiance of any size, rows from the top.
    ///
    /// # Errors
    /// Pictures of different sizes; what the library reports.
    pub fn denoise(
        &self,
        size: UVec2,
        colour: &[[f32; 3]],
        guides: Option<&Guides>,
        settings: &Settings,
    ) -> Result<Vec<[f32; 3]>, DenoiseError> {
        let device = Device::new(&self.functions)?;
        // With version 1 the picture depends on the number of threads.
        let threads = match self.version[0] {
            1 => 1,
            _ => settings.threads.map_or(0, c_int::from),
        };
        device.set_int(c"numThreads", threads);
        // The threads of the render stay where they are.
        device.set_bool(c"setAffinity", false);
        device.commit()?;
        let memory_mib = (settings.max_memory_bytes >> 20).clamp(1, 3000) as c_int;
        let filtered = |inputs: &[(&CStr, &[[f32; 3]])], flags: &[&CStr]| {
            let mut output = vec![[0.0; 3]; colour.len()];
            let mut filter = Filter::new(&device, size)?;
            for (name, picture) in inputs {
                filter.set_input(name, picture)?;
            }
            filter.set_output(c"output", &mut output)?;
            for flag in flags {
                filter.set_bool(flag, true);
            }
            filter.set_int(c"maxMemoryMB", memory_mib);
            filter.run()?;
            drop(filter);
            Ok(output)
        };
        let Some(guides) = guides else {
            return filtered(&[(c"color", colour)], &[c"hdr"]);
        };
        // Guides have noise of their own, which is removed first.
        let albedo = filtered(&[(c"albedo", &guides.albedo)], &[])?;
        let normal = filtered(&[(c"normal", &guides.normal)], &[])?;
        let inputs = [
            (c"color", colour),
            (c"albedo", &albedo),
            (c"normal", &normal),
        ];
        filtered(&inputs, &[c"hdr", c"cleanAux"])
    }
}

/// Loads a library whose functions others may use.
fn load_for_all(path: &Path) -> Result<libloading::Library, libloading::Error> {
    #[cfg(unix)]
    {
        use libloading::os::unix::{Library, RTLD_GLOBAL, RTLD_NOW};
        // SAFETY: see "Loading" above.
        unsafe { Library::open(Some(path), RTLD_NOW | RTLD_GLOBAL) }.map(Into::into)
    }
    #[cfg(not(unix))]
    // SAFETY: see "Loading" above.
    unsafe {
        libloading::Library::new(path)
    }
}

impl Functions {
    fn of(library: &libloading::Library) -> Result<Functions, libloading::Error> {
        /// The first of some names that the library has.
        fn get<T: Copy>(
            library: &libloading::Library,
            names: &[&CStr],
        ) -> Result<T, libloading::Error> {
            let mut result = Err(libloading::Error::DlSymUnknown);
            for name in names {
                // SAFETY: see "Signatures" above.
                result = unsafe { library.get::<T>(name.to_bytes_with_nul()) }.map(|s| *s);
                if result.is_ok() {
                    break;
                }
            }
            result
        }
        Ok(Functions {
            new_device: get(library, &[c"oidnNewDevice"])?,
            commit_device: get(library, &[c"oidnCommitDevice"])?,
            release_device: get(library, &[c"oidnReleaseDevice"])?,
            get_device_int: get(library, &[c"oidnGetDeviceInt", c"oidnGetDevice1i"])?,
            set_device_int: get(library, &[c"oidnSetDeviceInt", c"oidnSetDevice1i"])?,
            set_device_bool: get(library, &[c"oidnSetDeviceBool", c"oidnSetDevice1b"])?,
            get_device_error: get(library, &[c"oidnGetDeviceError"])?,
            new_filter: get(library, &[c"oidnNewFilter"])?,
            set_image: get(library, &[c"oidnSetSharedFilterImage"])?,
            set_filter_bool: get(library, &[c"oidnSetFilterBool", c"oidnSetFilter1b"])?,
            set_filter_int: get(library, &[c"oidnSetFilterInt", c"oidnSetFilter1i"])?,
            commit_filter: get(library, &[c"oidnCommitFilter"])?,
            execute_filter: get(library, &[c"oidnExecuteFilter"])?,
            release_filter: get(library, &[c"oidnReleaseFilter"])?,
        })
    }

    /// The error that the library holds for a device, if any; it is cleared.
    fn check(&self, device: Handle) -> Result<(), DenoiseError> {
        let mut message: *const c_char = std::ptr::null();
        // SAFETY: a device or null, which stands for errors without one.
        let code = unsafe { (self.get_device_error)(device, &mut message) };
        if code == 0 {
            return Ok(());
        }
        let text = match message.is_null() {
            true => format!("error {code}"),
            // SAFETY: see "Messages" above.
            false => unsafe { CStr::from_ptr(message) }
                .to_string_lossy()
                .into_owned(),
        };
        Err(DenoiseError::Failed(text))
    }
}

/// A device.
struct Device<'a> {
    functions: &'a Functions,
    handle: Handle,
}

impl<'a> Device<'a> {
    fn new(functions: &'a Functions) -> Result<Device<'a>, DenoiseError> {
        // SAFETY: see "Signatures" above.
        let handle = unsafe { (functions.new_device)(DEVICE_CPU) };
        if handle.is_null() {
            functions.check(handle)?;
            return Err(DenoiseError::Failed("there is no device".into()));
        }
        Ok(Device { functions, handle })
    }

    fn get_int(&self, name: &CStr) -> c_int {
        // SAFETY: see "Handles" above.
        unsafe { (self.functions.get_device_int)(self.handle, name.as_ptr()) }
    }

    fn set_int(&self, name: &CStr, value: c_int) {
        // SAFETY: see "Handles" above.
        unsafe { (self.functions.set_device_int)(self.handle, name.as_ptr(), value) }
    }

    fn set_bool(&self, name: &CStr, value: bool) {
        // SAFETY: see "Handles" above.
        unsafe { (self.functions.set_device_bool)(self.handle, name.as_ptr(), value) }
    }

    fn commit(&self) -> Result<(), DenoiseError> {
        // SAFETY: see "Handles" above.
        unsafe { (self.functions.commit_device)(self.handle) };
        self.functions.check(self.handle)
    }
}

impl Drop for Device<'_> {
    fn drop(&mut self) {
        // SAFETY: see "Handles" above.
        unsafe { (self.functions.release_device)(self.handle) }
    }
}

/// A filter for pictures of a size, which it borrows for `'p`.
struct Filter<'d, 'p> {
    device: &'d Device<'d>,
    handle: Handle,
    size: [usize; 2],
    pictures: PhantomData<&'p mut [[f32; 3]]>,
}

impl<'d, 'p> Filter<'d, 'p> {
    fn new(device: &'d Device<'d>, size: UVec2) -> Result<Filter<'d, 'p>, DenoiseError> {
        // SAFETY: see "Handles" above.
        let handle = unsafe { (device.functions.new_filter)(device.handle, c"RT".as_ptr()) };
        if handle.is_null() {
            device.functions.check(device.handle)?;
            return Err(DenoiseError::Failed("there is no filter".into()));
        }
        Ok(Filter {
            device,
            handle,
            size: [size.x as usize, size.y as usize],
            pictures: PhantomData,
        })
    }

    fn set_input(&mut self, name: &CStr, picture: &'p [[f32; 3]]) -> Result<(), DenoiseError> {
        // The library only reads it.
        self.set(name, picture.as_ptr().cast_mut(), picture.len())
    }

    fn set_output(&mut self, name: &CStr, picture: &'p mut [[f32; 3]]) -> Result<(), DenoiseError> {
        self.set(name, picture.as_mut_ptr(), picture.len())
    }

    fn set(&mut self, name: &CStr, start: *mut [f32; 3], len: usize) -> Result<(), DenoiseError> {
        let [width, height] = self.size;
        if width.checked_mul(height) != Some(len) {
            return Err(DenoiseError::Size);
        }
        let set = self.device.functions.set_image;
        // SAFETY: see "Pictures" above.
        unsafe {
            set(
                self.handle,
                name.as_ptr(),
                start.cast(),
                FLOAT3,
                width,
                height,
                0,
                0,
                0,
            );
        }
        Ok(())
    }

    fn set_bool(&self, name: &CStr, value: bool) {
        // SAFETY: see "Handles" above.
        unsafe { (self.device.functions.set_filter_bool)(self.handle, name.as_ptr(), value) }
    }

    fn set_int(&self, name: &CStr, value: c_int) {
        // SAFETY: see "Handles" above.
        unsafe { (self.device.functions.set_filter_int)(self.handle, name.as_ptr(), value) }
    }

    fn run(&mut self) -> Result<(), DenoiseError> {
        let functions = self.device.functions;
        // SAFETY: see "Pictures" above.
        unsafe { (functions.commit_filter)(self.handle) };
        functions.check(self.device.handle)?;
        // SAFETY: see "Pictures" above.
        unsafe { (functions.execute_filter)(self.handle) };
        functions.check(self.device.handle)
    }
}

impl Drop for Filter<'_, '_> {
    fn drop(&mut self) {
        // SAFETY: see "Handles" above.
        unsafe { (self.device.functions.release_filter)(self.handle) }
    }
}
