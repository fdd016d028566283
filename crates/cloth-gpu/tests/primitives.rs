//! Scan, sort and compaction on the device equal their twins.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod support;

use cloth_gpu::limits::{SCAN_BLOCK, SORT_BLOCK, WORKGROUP};
use cloth_gpu::stages::{compact::Compact, scan::Scan, scan::Sum, sort::Sort};
use cloth_gpu::{Array, Gpu, GpuError, GpuOptions, Length, Recorder, twin};
use support::{Random, device, variants};

/// The lengths at which kernels of blocks of `block` go wrong.
fn lengths(block: u32) -> Vec<u32> {
    vec![0, 1, WORKGROUP - 1, WORKGROUP, WORKGROUP + 1, block - 1, block, block + 1, 7 * block + 13, 100_003]
}

/// None if equal, else the first place that differs.
fn difference<T: PartialEq + std::fmt::Debug>(expected: &[T], got: &[T]) -> Option<String> {
    if expected.len() != got.len() {
        return Some(format!("expected {} elements, got {}", expected.len(), got.len()));
    }
    let at = (0..expected.len()).find(|&i| expected[i] != got[i])?;
    Some(format!("[{at}]: expected {:?}, got {:?}", expected[at], got[at]))
}

/// Words, small ones and now and then a large one.
fn words(n: u32, random: &mut Random) -> Vec<u32> {
    (0..n).map(|_| (random.bits() >> 32) as u32 >> (random.bits() & 31)).collect()
}

/// Scans `input[..n]` on the device. `most` ≥ n: the length is then a word on the device.
fn scan<S: Sum>(gpu: &Gpu, input: &[u32], n: u32, most: u32) -> Result<Vec<S>, GpuError> {
    let mut padded = input.to_vec();
    padded.resize(most as usize, 0xdead_beef);
    let array = Array::with(gpu, "input", &padded)?;
    let count = Array::with(gpu, "count", &[7, n])?;
    let output = Array::<S>::new(gpu, "output", most as usize + 1)?;
    let length = if most == n { Length::host(n) } else { Length::device(most, &count, 1) };
    let mut recorder = Recorder::new(gpu);
    Scan::<S>::new(gpu)?.record(&mut recorder, &array, length, &output)?;
    let copy = recorder.download(&output, 0..n as usize + 1);
    Ok(recorder.run()?.read(copy))
}

fn scan_agrees(gpu: &Gpu, n: u32, most: u32, random: &mut Random) {
    let input = words(n, random);
    let expected = twin::scan::scan(&input.iter().map(|&x| x.into()).collect::<Vec<_>>());
    let narrow: Vec<u32> = expected.iter().map(|&x| x as u32).collect();
    let wide: Vec<[u32; 2]> = expected.iter().map(|&x| [x as u32, (x >> 32) as u32]).collect();
    assert_eq!(difference(&narrow, &scan::<u32>(gpu, &input, n, most).unwrap()), None, "{n} of {most}");
    assert_eq!(difference(&wide, &scan::<[u32; 2]>(gpu, &input, n, most).unwrap()), None, "{n} of {most}");
}

#[test]
fn scan_matches_twin() {
    for options in variants() {
        let Some(device) = device(options) else { return };
        let mut random = Random(1);
        for n in lengths(SCAN_BLOCK) {
            scan_agrees(&device.gpu, n, n, &mut random);
            scan_agrees(&device.gpu, n, n + SCAN_BLOCK + 3, &mut random);
        }
        // Nothing of many.
        scan_agrees(&device.gpu, 0, 50_000, &mut random);
    }
}

/// Sorts on the device by `bits` bits; `most` as in [`scan`].
fn sort(gpu: &Gpu, entries: &[(u64, u32)], most: u32, bits: u32) -> Result<Vec<(u64, u32)>, GpuError> {
    let n = entries.len() as u32;
    let column = |f: fn(&(u64, u32)) -> u32| {
        let mut column: Vec<u32> = entries.iter().map(f).collect();
        column.resize(most as usize, 0xdead_beef);
        Array::with(gpu, "column", &column)
    };
    let (low, high, values) = (column(|e| e.0 as u32)?, column(|e| (e.0 >> 32) as u32)?, column(|e| e.1)?);
    let count = Array::with(gpu, "count", &[n])?;
    let length = if most == n { Length::host(n) } else { Length::device(most, &count, 0) };
    let mut recorder = Recorder::new(gpu);
    let mut stage = Sort::new(gpu)?;
    let wide = bits > 32;
    if wide {
        stage.record_wide(&mut recorder, &low, &high, &values, length, bits)?;
    } else {
        stage.record(&mut recorder, &low, &values, length, bits)?;
    }
    let copies = [&low, &high, &values].map(|a| recorder.download(a, 0..n as usize));
    let answer = recorder.run()?;
    let [low, high, values] = copies.map(|c| answer.read::<u32>(c));
    let key = |i: usize| u64::from(low[i]) | if wide { u64::from(high[i]) << 32 } else { 0 };
    Ok((0..n as usize).map(|i| (key(i), values[i])).collect())
}

fn sort_agrees(gpu: &Gpu, n: u32, most: u32, random: &mut Random) {
    for (bits, distinct) in [(32, u64::MAX), (32, 5), (64, u64::MAX), (64, 5), (20, u64::MAX), (44, 1 << 10)]
    {
        let mask = u64::MAX >> (64 - bits);
        let entries: Vec<(u64, u32)> = (0..n)
            .map(|i| ((random.bits() % distinct).wrapping_mul(0x0123_4567_89ab_cdef) & mask, i))
            .collect();
        let expected = twin::sort::sort(&entries, bits);
        let got = sort(gpu, &entries, most, bits).unwrap();
        assert_eq!(difference(&expected, &got), None, "{n} of {most}, {bits} bits, {distinct} keys");
    }
}

#[test]
fn sort_matches_twin() {
    for options in variants() {
        let Some(device) = device(options) else { return };
        let mut random = Random(2);
        for n in lengths(SORT_BLOCK) {
            sort_agrees(&device.gpu, n, n, &mut random);
        }
        sort_agrees(&device.gpu, 0, 3 * SORT_BLOCK, &mut random);
        sort_agrees(&device.gpu, 2 * SORT_BLOCK, 7 * SORT_BLOCK + 5, &mut random);
        sort_agrees(&device.gpu, SORT_BLOCK + 1, 100_003, &mut random);
    }
}

fn compact_agrees(gpu: &Gpu, n: u32, random: &mut Random) {
    let flags: Vec<u32> = (0..n).map(|_| (random.bits() & 1) as u32).collect();
    let values = words(n, random);
    let (f, v) = (Array::with(gpu, "flags", &flags).unwrap(), Array::with(gpu, "values", &values).unwrap());
    let offsets = Array::<u32>::new(gpu, "offsets", n as usize + 1).unwrap();
    let kept = Array::<u32>::new(gpu, "kept", n as usize).unwrap();
    let mut recorder = Recorder::new(gpu);
    Compact::new(gpu).unwrap().record(&mut recorder, &f, &v, Length::host(n), &offsets, &kept).unwrap();
    let copies =
        [recorder.download(&offsets, n as usize..n as usize + 1), recorder.download(&kept, 0..n as usize)];
    let answer = recorder.run().unwrap();
    let count = answer.read::<u32>(copies[0])[0] as usize;
    let scanned = twin::scan::scan(&flags.iter().map(|&x| x.into()).collect::<Vec<_>>());
    let expected = twin::compact::compact(&flags, &scanned, &values);
    assert_eq!(difference(&expected, &answer.read::<u32>(copies[1])[..count]), None, "{n}");
}

#[test]
fn compaction_matches_twin() {
    for options in variants() {
        let Some(device) = device(options) else { return };
        let mut random = Random(3);
        for n in lengths(SCAN_BLOCK) {
            compact_agrees(&device.gpu, n, &mut random);
        }
    }
}

#[test]
fn ten_million_elements_agree() {
    let Some(device) = device(GpuOptions::default()) else { return };
    let (n, mut random) = (10_000_000, Random(4));
    scan_agrees(&device.gpu, n, n, &mut random);
    compact_agrees(&device.gpu, n, &mut random);
    for bits in [32, 64] {
        let entries: Vec<(u64, u32)> = (0..n).map(|i| (random.bits() >> (64 - bits), i)).collect();
        let mut expected = entries.clone();
        expected.sort_by_key(|e| e.0);
        assert_eq!(
            difference(&expected, &sort(&device.gpu, &entries, n, bits).unwrap()),
            None,
            "{bits} bits"
        );
    }
}

#[test]
fn planted_fault_is_caught() {
    let mut random = Random(5);
    let good = words(1000, &mut random);
    let mut bad = good.clone();
    bad[777] ^= 1;
    assert!(difference(&good, &bad).is_some_and(|d| d.starts_with("[777]")));
    assert!(difference(&good, &good[..999]).is_some());
    // The twins see a scan that drops a block's base, and a sort that forgets the order of equal keys.
    let ones = vec![1u64; 2 * SCAN_BLOCK as usize];
    assert!(difference(&twin::scan::scan(&ones), &twin::scan::scan_apply(&ones, &[])).is_some());
    let entries: Vec<(u64, u32)> = (0..100).map(|i| (7, i)).collect();
    let reversed: Vec<(u64, u32)> = entries.iter().rev().copied().collect();
    assert!(difference(&twin::sort::sort(&entries, 32), &reversed).is_some());
}

#[test]
fn limits_are_errors() {
    let options = GpuOptions { max_binding_bytes: Some(1 << 16), ..GpuOptions::default() };
    let Some(device) = device(options) else { return };
    let too_large = Array::<u32>::new(&device.gpu, "long", 1 << 15);
    assert!(matches!(too_large, Err(GpuError::TooLarge { needed: 0x20000, limit: 0x10000, .. })));
    let mut array = Array::<u32>::new(&device.gpu, "growing", 1000).unwrap();
    array.grow(&device.gpu, 16_000).unwrap();
    assert_eq!(array.capacity(), 1 << 14);
    assert!(matches!(array.grow(&device.gpu, (1 << 14) + 1), Err(GpuError::TooLarge { .. })));
    assert_eq!(array.capacity(), 1 << 14);
}

#[test]
fn too_many_workgroups_are_an_error() {
    let options = GpuOptions { max_workgroups_per_dimension: Some(4), ..GpuOptions::default() };
    let Some(device) = device(options) else { return };
    assert!(
        scan::<u32>(&device.gpu, &vec![1; 16 * SCAN_BLOCK as usize], 16 * SCAN_BLOCK, 16 * SCAN_BLOCK)
            .is_ok()
    );
    let n = 17 * SCAN_BLOCK;
    let refused = scan::<u32>(&device.gpu, &vec![1; n as usize], n, n);
    assert!(matches!(refused, Err(GpuError::TooManyWorkgroups { needed: 17, limit: 16, .. })), "{refused:?}");
}

#[test]
fn waits_end() {
    let options = GpuOptions { timeout: std::time::Duration::from_nanos(1), ..GpuOptions::default() };
    let Some(device) = device(GpuOptions { subgroups: false, ..options }) else { return };
    let n = 4_000_000;
    let hung = scan::<u32>(&device.gpu, &vec![1; n as usize], n, n);
    assert!(matches!(hung, Err(GpuError::Timeout { .. })), "{:?}", hung.map(|v| v.len()));
}

#[test]
fn stages_are_measured() {
    let Some(device) = device(GpuOptions::default()) else { return };
    let input = Array::with(&device.gpu, "input", &vec![1u32; 1 << 20]).unwrap();
    let output = Array::<u32>::new(&device.gpu, "output", (1 << 20) + 1).unwrap();
    let mut recorder = Recorder::new(&device.gpu);
    recorder.stage("scan");
    Scan::new(&device.gpu).unwrap().record(&mut recorder, &input, Length::host(1 << 20), &output).unwrap();
    recorder.stage("empty");
    let answer = recorder.run().unwrap();
    if device.gpu.has_timestamps() {
        assert_eq!(answer.seconds.iter().map(|s| s.0).collect::<Vec<_>>(), ["scan", "empty"]);
        assert!(answer.seconds[0].1 > answer.seconds[1].1, "{:?}", answer.seconds);
    } else {
        assert!(answer.seconds.is_empty());
    }
}

#[test]
fn the_device_describes_itself() {
    let Some(device) = device(GpuOptions::default()) else { return };
    let gpu = &device.gpu;
    println!(
        "{}: software {}, subgroups {}, timestamps {}, {} MiB per binding",
        gpu.description(),
        gpu.is_software(),
        gpu.has_subgroups(),
        gpu.has_timestamps(),
        gpu.max_binding_bytes() >> 20
    );
    assert!(!gpu.description().is_empty() && gpu.max_binding_bytes() >= 1 << 27);
}
