//! Indices and absorption from files.

use super::common::{CAMERA, SPREAD_NM, assert_close, bench_with, ray, try_bench, v, wavelengths};
use abbe::math::sampler::Sampler;
use std::f64::consts::PI;

/// A slab of water, 3 m thick, whose n is that of air: light through it by σ = 4πk/λ of the file, for each wavelength.
/// k is linear between the samples.
#[test]
fn a_body_absorbs_by_the_k_of_its_file() {
    let file = "DATA:\n- type: tabulated nk\n  data: |\n    0.3 1 2.0e-8\n    0.6 1 4.0e-8\n    0.9 1 1.0e-7\n";
    let csv = "wl,n\n0.3,1\n0.9,1\n\nwl,k\n0.3,2.0e-8\n0.6,4.0e-8\n0.9,1.0e-7\n";
    for (ior, absorption) in [("{file: w.yml}", ""), ("{file: w.csv}", ""), ("1", ", absorption: {file: w.yml}")] {
        let text = format!(
            "{CAMERA}shapes:\n- cube: {{size: 3, material: {{dielectric: {{ior: {ior}{absorption}}}}}}}\n\
             lights: [{{constant: {{radiance: 1}}}}]\n"
        );
        let scene = bench_with(&text, &[("w.yml", file.as_bytes()), ("w.csv", csv.as_bytes())]);
        for (found, nm) in scene.lanes(&ray(v(0.0, 0.1, 5.0), v(0.0, 0.1, 0.0))).into_iter().zip(SPREAD_NM) {
            let k = if nm < 600.0 { 2e-8 + 2e-8 * (nm - 300.0) / 300.0 } else { 4e-8 + 6e-8 * (nm - 600.0) / 300.0 };
            assert_close(found, (-3.0 * 4.0 * PI * k / (nm * 1e-9)).exp(), 1e-5);
        }
    }
}

/// What a way leaves, twice the way leaves squared: Beer and Lambert from a colour at a distance.
#[test]
fn a_colour_at_a_distance_is_what_that_way_leaves() {
    let table = "{table: [[360, 0.2], [830, 0.9]]}";
    let text = format!(
        "{CAMERA}shapes:\n- cube: {{size: 2, material: {{dielectric: {{ior: 1.5, absorption: {{color: {table}, at: 1}}}}}}}}\n\
         lights: [{{constant: {{radiance: 1}}}}]\n"
    );
    let scene = bench_with(&text, &[]);
    let beam = ray(v(0.0, 0.1, 5.0), v(0.0, 0.1, 0.0));
    let samples = (0..64).map(|index| {
        let sampler = Sampler::new(1, [0, 0], 0, index);
        scene.incoming(&beam, &wavelengths(SPREAD_NM), &sampler).radiance.to_array().map(f64::from)
    });
    // Of light that is not reflected at once, the brightest came straight through.
    let through = samples.filter(|l| l[0] < 0.9).fold([0.0f64; 8], |a, b| std::array::from_fn(|k| a[k].max(b[k])));
    for (found, nm) in through.into_iter().zip(SPREAD_NM) {
        let color = 0.2 + 0.7 * (nm - 360.0) / 470.0;
        // The logarithm is linear between whole nanometres.
        assert_close(found, color * color, 1e-4);
    }
}

/// A metal from a file is that metal written out.
#[test]
fn a_metal_from_a_file_is_the_same_written_out() {
    let file = "DATA:\n- type: tabulated nk\n  data: |\n    0.3 0.2 3\n    0.6 0.4 5\n    0.9 0.6 9\n";
    let scene = |index: &str| {
        let text = format!(
            "{CAMERA}shapes:\n- sphere: {{radius: 1, material: {{conductor: {{{index}}}}}}}\n\
             lights: [{{constant: {{radiance: 1}}}}]\n"
        );
        bench_with(&text, &[("m.yml", file.as_bytes())]).lanes(&ray(v(0.3, 0.0, 5.0), v(0.3, 0.0, 0.0)))
    };
    let written =
        scene("eta: {table: [[300, 0.2], [600, 0.4], [900, 0.6]]}, k: {table: [[300, 3], [600, 5], [900, 9]]}");
    for (a, b) in scene("file: m.yml").into_iter().zip(written) {
        assert_close(a, b, 1e-6);
    }
}

#[test]
fn files_that_cannot_be_used_are_told_with_both_places() {
    let told = |material: &str, file: &str| {
        let text = format!(
            "{CAMERA}materials:\n  m: {material}\nshapes: [{{disk: {{normal: [0, 1, 0], radius: 1, material: m}}}}]\n"
        );
        try_bench(&text, &[("f.yml", file.as_bytes())]).err().unwrap_or_default()
    };
    let clear = "{dielectric: {ior: {file: f.yml}}}";
    let nk = |n: f64, k: f64| format!("DATA:\n- type: tabulated nk\n  data: |\n    0.3 {n} {k}\n    0.9 {n} {k}\n");
    assert_eq!(
        told(clear, "DATA:\n- type: tabulated n\n  data: |\n    0.4 1.5\n    0.7 1.5\n"),
        "DIR/f.yml: line 4, column 5: DATA[0].data: expected a table of 360 to 830 nm, found 400 to 700 nm; it is named at \
         DIR/scene.yaml:4:32: materials.m.dielectric.ior.file"
    );
    assert!(told(clear, &nk(0.2, 3.0)).starts_with(
        "DIR/scene.yaml:4:32: materials.m.dielectric.ior.file: expected something clear, with n of 1 or more and k up to \
         0.1, found 0.2 + 3i at 360 nm; metals are written conductor: {file: …}"
    ));
    assert!(
        told(clear, "DATA:\n- type: tabulated n\n  data: |\n    0.3 0.9\n    0.9 0.9\n")
            .contains("found 0.9 without k")
    );
    assert!(told("{dielectric: {ior: {file: none.yml}}}", "").contains("none.yml: expected a file, found none"));
    assert!(
        told("{conductor: {file: f.yml}}", "DATA:\n- type: tabulated n\n  data: |\n    0.3 0.9\n    0.9 0.9\n")
            .contains("expected both n and k")
    );
    assert!(
        told("{dielectric: {ior: 1.5, absorption: {color: 0, at: 1}}}", "").contains("expected some light to be left")
    );
    assert!(
        told("{dielectric: {ior: 1.5, absorption: {color: 0.5, at: 0}}}", "")
            .contains("absorption.at: expected a number greater than 0")
    );
    // ln 2 over 10⁻³⁹ m is more than f32 holds.
    assert!(
        told("{dielectric: {ior: 1.5, absorption: {color: 0.5, at: 1.0e-39}}}", "")
            .contains("absorption.at: expected a length over which no more than 3.4e38 m⁻¹ is absorbed, found 1e-39")
    );
    assert!(
        told(clear, &nk(1.3, 1e-8))
            .contains("expected a closed shape or a plane for a material that absorbs, found an open disk")
    );
    assert!(
        told("{conductor: {metal: gold, file: f.yml}}", "")
            .contains("expected either metal, or file, or eta and k, found metal and file")
    );
}

/// A glass whose k begins at `from` µm, as that of dense flints does: its first value is held where it is needed, and of no account
/// beside another absorption.
#[test]
fn a_k_that_ends_within_the_band_is_held_with_a_note_or_passed_over() {
    let notes = |absorption: &str, from: f64| {
        let file = format!(
            "DATA:\n- type: formula 5\n  wavelength_range: 0.3 2.4\n  coefficients: 1.5\n- type: tabulated k\n  data: |\n    \
             {from} 1e-8\n    2.4 1e-8\n"
        );
        let text = format!(
            "{CAMERA}shapes:\n- sphere: {{radius: 1, material: {{dielectric: {{ior: {{file: f.yml}}{absorption}}}}}}}\n"
        );
        try_bench(&text, &[("f.yml", file.as_bytes())]).map(|scene| scene.prepared.scene.notes.join("\n"))
    };
    assert!(notes("", 0.37).unwrap().contains("k is stated for 370 to 2400 nm and held over 360 to 830 nm"));
    let fault = notes("", 0.45).unwrap_err();
    assert!(fault.contains("DATA[1].data: k: expected a table of 405 to 700 nm, found 450 to 2400 nm"), "{fault}");
    for absorption in [", absorption: none", ", absorption: {color: 0.5, at: 1}"] {
        for from in [0.37, 0.45] {
            assert!(!notes(absorption, from).unwrap().contains("k is stated"), "{absorption} {from}");
        }
    }
}

const SHOWN: &str = "shapes: [{sphere: {radius: 1, material: {mask: {material: m}}}}]\n";

#[test]
fn what_is_used_beyond_its_range_is_noted() {
    let notes = |ior: &str| {
        let scene = bench_with(&format!("{CAMERA}materials: {{m: {{dielectric: {{ior: {ior}}}}}}}\n{SHOWN}"), &[]);
        scene.prepared.scene.notes.join("\n")
    };
    assert!(
        notes("{glass: SF11}")
            .ends_with("SF11: the formula is stated for 390 to 2500 nm and continued to 360 to 830 nm")
    );
    let below = "below 1 and without k, is right as a ratio to another only";
    assert!(notes("0.9").ends_with(&format!("an index of 0.9 at 360 nm, {below}")));
    // 1 + 0.1 (600 − nm)/300 falls below 1 beyond 600 nm.
    assert!(notes("{table: [[300, 1.1], [900, 0.9]]}").contains("at 601 nm, below 1"));
    assert_eq!(notes("{glass: N-BK7}"), "");
    // What nothing shows needs no word.
    let unused = bench_with(&format!("{CAMERA}materials: {{m: {{dielectric: {{ior: 0.9}}}}}}\n"), &[]);
    assert!(unused.prepared.scene.notes.is_empty());
}
