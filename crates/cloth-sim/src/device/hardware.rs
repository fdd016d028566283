//! Whether there can be a GPU at all, asked without loading any driver.

/// Device files of GPUs, one of which every Linux driver of a GPU goes through: DRM (AMD, Intel, NVIDIA, Mali, …), NVIDIA's own,
/// WSL, Adreno, Mali's own, `PowerVR`.
#[cfg(target_os = "linux")]
const FILES: [(&str, &str); 7] = [
    ("/dev/dri", "card"),
    ("/dev/dri", "renderD"),
    ("/dev", "nvidia"),
    ("/dev", "dxg"),
    ("/dev", "kgsl"),
    ("/dev", "mali"),
    ("/dev", "pvr"),
];

/// What speaks against a GPU, in words, if anything does: on Linux that no device file of one is there. Asking the drivers loads
/// them all, software adapters too, which takes a tenth of a second.
#[cfg(target_os = "linux")]
pub(super) fn absent() -> Option<String> {
    let starts = |&(folder, start): &(&str, &str)| {
        let Ok(entries) = std::fs::read_dir(folder) else { return false };
        entries.flatten().any(|entry| entry.file_name().to_string_lossy().starts_with(start))
    };
    (!FILES.iter().any(starts))
        .then(|| "no device file of one (/dev/dri/card0, /dev/nvidia0, /dev/dxg, …)".to_owned())
}

/// Only the drivers know.
#[cfg(not(target_os = "linux"))]
pub(super) fn absent() -> Option<String> {
    None
}
