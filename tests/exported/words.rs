//! What Mitsuba has no words for is told, and comes back.

use super::exported_with;

/// Where no lamp is looked for Mitsuba 3.9.1 finds "no probability mass" and renders nothing: it looks for all, which is told.
#[test]
fn a_scene_in_which_no_lamp_is_looked_for_is_one_of_mitsubas() {
    let lights = |weight: u32| {
        format!(
            "lights: [{{point: {{position: [1, 3, 1], intensity: 5, sampling_weight: 0}}}}, \
             {{constant: {{radiance: 0.3, sampling_weight: {weight}}}}}, {{constant: {{radiance: 0.1}}}}]\n"
        )
    };
    let disk = "disk: {center: [-1, 1.5, 0], normal: [0, -1, 0], radius: 0.5, emission: 3, sampling_weight: 0}";
    let second = "lights[2]: nothing: Mitsuba has one environment".to_owned();
    let (losses, xml) = exported_with(&lights(0), disk);
    let lamps = ["shapes[1].disk", "lights[0].point", "lights[1].constant"];
    let told =
        lamps.map(|lamp| format!("{lamp}.sampling_weight: 1: Mitsuba wants one lamp at least that it looks for"));
    assert_eq!(losses, [&told[..], std::slice::from_ref(&second)].concat());
    assert!(!xml.contains("name=\"sampling_weight\""), "{xml}");
    let (losses, xml) = exported_with(&lights(2), disk);
    assert_eq!(losses, [second]);
    assert_eq!(xml.matches("name=\"sampling_weight\" value=\"0\"").count(), 2, "{xml}");
}

/// 1 − cos of half its angle is 0 in single precision, by which Mitsuba 3.9.1 divides: no pixel is a number.
#[test]
fn a_sun_that_is_too_narrow_for_mitsuba_is_wider_there() {
    for (angle, there, is_told) in [(0.001, 0.05, true), (0.05, 0.05, false), (0.5, 0.5, false)] {
        let head = format!("lights: [sky: {{sun: {{elevation_deg: 40}}, sun_angle_deg: {angle}}}]\n");
        let (losses, xml) = exported_with(&head, "sphere: {radius: 0.3}");
        let told = ["lights[0]: a sun of 0.05 degrees, as bright: narrower ones are none for Mitsuba"];
        assert_eq!(losses, if is_told { &told[..] } else { &[] });
        assert!(xml.contains(&format!("<float name=\"sun_aperture\" value=\"{there}\"/>")), "{xml}");
    }
}

/// A slide hangs upside down for Mitsuba and is written again; what that cannot say is told of the light, too, whose own words
/// bring it back.
#[test]
fn slides_keep_what_mitsuba_cannot_say() {
    let edges = "one way to go on beyond the edges for u and v";
    let grey = "grey squares in place of a spectrum";
    for (texture, light, told) in [
        (
            "image: {file: EARTH, wrap_v: clamp, scale: [1.5, 2.5]}",
            "spot: {position: [0, 3, 0], target: [0, 0, 0], up: [0, 0, -1], cutoff_deg: 30, intensity: 10, texture: slide}",
            vec![format!("textures.slide: {edges}"), format!("lights[0]: {edges}")],
        ),
        (
            "checkerboard: {a: {file: red.csv}, b: 0.2}",
            "projector: {origin: [0, 3, 0], target: [0, 0, 0], up: [0, 0, -1], fov_deg: 40, irradiance: {texture: slide}}",
            vec![format!("textures.slide: {grey}"), format!("lights[0]: {grey}")],
        ),
        (
            "checkerboard: {a: {file: red.csv}, b: 0.2}",
            "projector: {origin: [0, 3, 0], target: [0, 0, 0], up: [0, 0, -1], fov_deg: 40, v: down, irradiance: {texture: slide}}",
            vec![format!("textures.slide: {grey}")],
        ),
    ] {
        let head = format!("textures: {{slide: {{{texture}}}}}\nlights: [{light}]\n");
        let (losses, xml) = exported_with(&head, "sphere: {radius: 0.3}");
        assert_eq!(losses, told, "{xml}");
    }
}

/// Mitsuba 3.9.1 shows a picture on a disk where it is here, whichever way that looks, and on a tube, be its seam elsewhere than the ends
/// have it.
#[test]
fn pictures_on_disks_and_tubes_lie_where_mitsuba_has_them() {
    let head =
        "textures: {photo: {image: {file: EARTH}}}\nmaterials: {card: {diffuse: {reflectance: {texture: photo}}}}\n";
    let tube = |base: &str, top: &str, more: &str| {
        format!("cylinder: {{base: {base}, top: {top}, radius: 0.2, caps: none, material: card{more}}}")
    };
    let (low, high) = ("[0, 0.5, 0]", "[0.3, 1, 0.4]");
    for (shape, is_turned) in [
        ("disk: {center: [0, 1, 0], normal: [0.3, 0.5, 1], radius: 0.5, material: card}".to_owned(), false),
        ("disk: {center: [0, 1, 0], normal: [0, 0, -1], radius: 0.5, material: card}".to_owned(), false),
        (tube(low, high, ""), false),
        (tube(high, low, ""), true),
        (tube(low, high, ", seam: [0, 0, 1]"), true),
    ] {
        let (losses, xml) = exported_with(head, &shape);
        assert_eq!(losses, [""; 0], "{shape}");
        assert_eq!(xml.contains("instead shape"), is_turned, "{shape}: {xml}");
    }
}

/// Of the parameter of the file, of the ends by which kinds are told apart, of what separates words, and of nothing.
#[test]
fn names_are_those_that_they_were() {
    for name in ["$spp", "of $spp samples", "red (bsdf)", "red (texture)", "two\\twords", "two\\nlines", ""] {
        let head = format!(
            "textures: {{\"{name}\": {{checkerboard: {{a: 0.2, b: 0.7}}}}}}\n\
             materials: {{\"{name}\": {{diffuse: {{reflectance: {{texture: \"{name}\"}}}}}}}}\n\
             groups: {{\"{name}\": [{{sphere: {{radius: 0.2, material: \"{name}\"}}}}]}}\n"
        );
        // The sphere and the cone stand there as they were written, too.
        let shapes = format!(
            "instance: {{group: \"{name}\"}}\n\
             - cone: {{base: [0, 0, 0], apex: [0, 1, 0], radius: 0.3, material: \"{name}\", name: \"{name}\"}}"
        );
        let (_, xml) = exported_with(&head, &shapes);
        assert!(xml.contains("value=\"$spp\""), "{xml}");
    }
}

/// Mitsuba 3.9.1 reads such a scene and ends by a fault of memory as soon as it renders.
#[test]
fn lamps_have_no_attributes_of_their_mesh_there() {
    let head = "textures: {paint: {mesh_attribute: {name: vertex_color}}}\n";
    let mesh = |rest: &str| format!("mesh: {{file: painted.ply, normals: vertex, winding: world, {rest}}}");
    let (losses, xml) = exported_with(head, &mesh("emission: {texture: paint}"));
    assert_eq!(
        losses,
        ["shapes[1]: an even radiance of 1: Mitsuba crashes where a lamp has the attributes of its mesh"]
    );
    assert!(xml.contains("<spectrum name=\"radiance\" value=\"1\"/>"), "{xml}");
    let (losses, _) = exported_with(head, &mesh("material: {diffuse: {reflectance: {texture: paint}}}"));
    assert_eq!(losses, [""; 0]);
    // It wants texture coordinates of others, too.
    let bare = "an even radiance of 1: Mitsuba wants texture coordinates of a mesh that shines by a texture";
    let head = "textures: {photo: {image: {file: EARTH}}}\n";
    for shape in [
        &mesh("emission: {texture: photo}"),
        "cone: {base: [0, 0, 0], apex: [0, 1, 0], radius: 0.3, emission: {texture: photo}}",
    ] {
        let (losses, _) = exported_with(head, shape);
        assert!(losses.len() == 1 && losses[0].ends_with(bare), "{losses:?}");
    }
}

/// Mitsuba 3.9.1 refuses three numbers of a mesh where one is wanted, and where a colour is takes those of a name without "color"
/// for coefficients: a floor of 0.8, 0.3, 0.1 is 0.995 there. The mean of red, green and blue by luminance is a third of all three.
#[test]
fn three_numbers_of_a_mesh_that_mitsuba_takes_otherwise_are_told() {
    let attribute = |name: &str| format!("textures: {{paint: {{mesh_attribute: {{name: {name}, scale: 0.5}}}}}}\n");
    let mesh = |file: &str, material: &str| {
        format!("mesh: {{file: {file}, normals: vertex, winding: world, material: {{{material}}}}}")
    };
    let metal = "conductor: {eta: 0.2, k: 3, roughness: {texture: paint}}";
    let (losses, xml) = exported_with(&attribute("vertex_color"), &mesh("painted.ply", metal));
    let instead = "0.1667 everywhere: Mitsuba takes no three numbers of a mesh for one";
    assert_eq!(losses, [format!("textures.paint: {instead}")]);
    assert!(xml.contains("<float name=\"alpha\" value=\"0.16666"), "{xml}");
    let paper = "diffuse: {reflectance: {texture: paint}}";
    assert_eq!(exported_with(&attribute("vertex_color"), &mesh("painted.ply", paper)).0, [""; 0]);
    let (losses, _) = exported_with(&attribute("vertex_paint"), &mesh("numbered.ply", paper));
    assert!(losses.len() == 1 && losses[0].starts_with("textures.paint: spectra that have its"), "{losses:?}");
}

/// Under D65 stands the picture as it was written, which need not say what light it is of.
#[test]
fn lamps_with_pictures_that_stand_as_they_were_come_back() {
    let lamp = "rectangle: {corner: [-1, 0.2, 0], edge_u: [2, 0, 0], edge_v: [0, 1, 0], emission: {texture: photo}}";
    for illuminant in ["", ", illuminant: {name: D65, scale: 2}"] {
        let head =
            format!("textures: {{photo: {{image: {{file: EARTH, wrap_v: clamp, scale: [1.5, 2]{illuminant}}}}}}}\n");
        let (losses, xml) = exported_with(&head, lamp);
        assert_eq!(losses, ["textures.photo: one way to go on beyond the edges for u and v"]);
        assert!(xml.contains("<ref name=\"picture\" id=\"photo\"/>"), "{xml}");
    }
}

/// Where it is told to, Mitsuba's `twosided` lets light through: so it does in the file, and read back.
#[test]
fn two_sides_may_let_light_through() {
    let card = |sides: &str| {
        format!(
            "rectangle: {{corner: [-1, 0, 0], edge_u: [2, 0, 0], edge_v: [0, 1, 0], material: {{two_sided: {{{sides}}}}}}}"
        )
    };
    for (sides, plugin) in [
        ("front: {mask: {opacity: 0.4, material: {diffuse: {two_sided: false}}}}", "mask"),
        ("front: {thin_dielectric: {ior: 1.5}}, back: {diffuse: {reflectance: 0.2}}", "thindielectric"),
        ("front: {thin_dielectric: {ior: 1.5}}", "thindielectric"),
        ("front: {principled_thin: {diff_trans: 1}}", "principledthin"),
        ("front: {hair: {absorption: 0.5}}", "hair"),
    ] {
        let (losses, xml) = exported_with("", &card(sides));
        assert!(losses.iter().all(|loss| loss.starts_with("integrator.")), "{losses:?}");
        for words in
            [format!("<bsdf type=\"{plugin}\">"), "<boolean name=\"allow_transmission\" value=\"true\"/>".to_owned()]
        {
            assert!(xml.contains(&words) && !xml.contains("instead"), "{xml}");
        }
    }
    let (_, opaque) = exported_with("", &card("front: {diffuse: {}}, back: {mirror: {reflectance: 0.5}}"));
    assert!(!opaque.contains("allow_transmission"), "{opaque}");
}

/// A file that Mitsuba refuses, or another picture without a word, is none: what it has no words for is told, all of it.
#[test]
fn what_mitsuba_would_refuse_is_written_otherwise_and_told() {
    let card = |material: &str| {
        format!("rectangle: {{corner: [-1, 0, 0], edge_u: [2, 0, 0], edge_v: [0, 1, 0], material: {{{material}}}}}")
    };
    let textures = "textures: {earth: {image: {file: EARTH}}, data: {image: {file: EARTH, raw: true}}, \
                    board: {checkerboard: {a: {texture: earth}, b: 0.3}}, waves: {image: {file: WAVES, raw: true}}}\n";
    let grey = card("diffuse: {}");
    const BALL: &str = "sphere: {center: [0, 0.5, 0], radius: 0.5, material: {boundary: {}}, inside: m}";
    let cases: &[(&str, &str, &[&str], &[&str])] = &[
        (
            "",
            "curves: {file: hair.txt, basis: bspline, flip_normals: true}",
            &["shapes[1]: the same shape with its normals outward: Mitsuba's has no others"],
            &[],
        ),
        (
            "textures: {lamp: {checkerboard: {a: {illuminant: A}, b: {scaled: {by: 2, of: {blackbody: {kelvin: 3000}}}}}}}\n",
            &grey,
            &["textures.lamp: its spectra at every fifth nanometre"],
            &["<spectrum name=\"color0\" value=\"360:", "<spectrum name=\"color1\" value=\"360:"],
        ),
        (
            "textures: {lamp: {checkerboard: {a: {illuminant: A}, b: {file: red.csv}}}}\n",
            &grey,
            &["textures.lamp: grey squares in place of a spectrum"],
            &["<spectrum name=\"color0\" value=\"360:", "<spectrum name=\"color1\" value=\"0.5\"/>"],
        ),
        (
            "image: {filter: {lanczos: {radius: 2.5}}}\n",
            &grey,
            &["image.filter: 3 lobes: Mitsuba's are whole"],
            &["<integer name=\"lobes\" value=\"3\"/>"],
        ),
        (
            "image: {filter: {mitchell: {b: 0.9, c: 0.05}}, sensitivity: 3}\n",
            &grey,
            &["image.sensitivity: a film of sensitivity 1"],
            &["<float name=\"B\" value=\"0.9\"/>", "<float name=\"C\" value=\"0.05\"/>"],
        ),
        (
            "camera: {origin: [0, 1, 4], target: [0, 0.5, 0], orthographic_height: 3, principal_point: [0.2, -0.1], \
             lens: {radius: 0.2, focus_distance: 4}}\n",
            &grey,
            &[
                "camera.lens: none: Mitsuba's orthographic camera has no lens",
                "camera.principal_point: the middle of the picture: Mitsuba has another for a pinhole with a perspective alone",
            ],
            &[],
        ),
        (
            "",
            // 1.5 + 4000 / 587.5618² = 1.51159.
            &card("plastic: {roughness: 0.3, ior: {cauchy: [1.5, 0.004]}, reflectance: {file: red.csv}}"),
            &[
                "shapes[1].rectangle.material: the index at 587.5618 nm, 1.5116 over 1.0000: Mitsuba has no dispersion; \
               grey in place of a spectrum; the coat's mean over 64 cosines, which makes the base darker by up to 2 %",
            ],
            &[],
        ),
        (
            "volumes: {v: {constant: {value: 0.3}}}\ntextures: {t: {volume: v}, b: {checkerboard: {a: {texture: t}, b: 0.3}}}\n",
            &card("plastic: {reflectance: {texture: b}, tint: {texture: t}}"),
            &[
                "shapes[1].rectangle.material: a base of 0.5 and no tint: Mitsuba's plastics want the mean of a texture, which it \
               does not have of volumes and of attributes of meshes",
            ],
            &["<float name=\"diffuse_reflectance\" value=\"0.5\"/>"],
        ),
        (
            "",
            // Nothing is bent by the index around it, and what is not bent is not scattered: the picture is that of smooth glass.
            "sphere: {radius: 0.5, material: {dielectric: {roughness: 0.2, ior: 1.5, exterior_ior: 1.5}}}",
            &[],
            &["<bsdf type=\"dielectric\">", "<float name=\"int_ior\" value=\"1.5\"/>"],
        ),
        (
            "",
            // Half a step of a 32-bit float above 1.5 is 6e-8.
            "sphere: {radius: 0.5, material: {dielectric: {roughness: 0.2, ior: 1.50000001, exterior_ior: 1.5}}}",
            &[
                "shapes[1].sphere.material: an index a millionth above that around it: Mitsuba wants those of what is rough to differ",
            ],
            &["<float name=\"int_ior\" value=\"1.500001"],
        ),
        (
            "",
            "sphere: {radius: 0.5, material: {dielectric: {ior: 1.5, exterior_ior: 1.5}}}",
            &[],
            &["<float name=\"int_ior\" value=\"1.5\"/>"],
        ),
        (
            "",
            "sphere: {radius: 0.5, material: {dielectric: {ior: {file: inky.csv}}}}",
            &["shapes[1].sphere.material: the index at 587.5618 nm, 1.5000 over 1.0000: Mitsuba has no dispersion; \
               no absorption inside, which Mitsuba has in media only"],
            &[],
        ),
        (
            "",
            // 0.5 (1 - cos(pi/256)) = 3.765e-5.
            "cone: {base: [0, 0, 0], apex: [0, 1, 0], radius: 0.5, emission: {lines: [{nm: 589, power: 1}]}}",
            &["shapes[1]: a mesh of 256 sides, at most 3.76e-5 m inside: Mitsuba has no cone; a grey light"],
            &[],
        ),
        (
            textures,
            &card("mask: {opacity: {texture: earth}, material: {diffuse: {}}}"),
            &["textures.earth: its numbers as they are stored: Mitsuba takes them from raw pictures alone"],
            &["<boolean name=\"raw\" value=\"true\"/>"],
        ),
        (
            textures,
            &card("diffuse: {reflectance: {texture: data}}"),
            &["textures.data: its colours by the curve of sRGB: Mitsuba takes raw ones for numbers alone"],
            &[],
        ),
        (
            textures,
            &card("bump: {height: {texture: board}, material: {diffuse: {}}}"),
            &["shapes[1].rectangle.material: what it covers: Mitsuba has no slopes but of pictures"],
            &["<bsdf type=\"mask\">"],
        ),
        (
            textures,
            &card("normal_map: {normals: {texture: waves}, material: {diffuse: {}}}"),
            &[
                "shapes[1].rectangle.material: what it covers: normals are written for Mitsuba as pictures in colour alone",
            ],
            &["<bsdf type=\"mask\">"],
        ),
        (
            textures,
            &card("diffuse: {}").replace("material: {diffuse: {}}", "emission: {texture: board}"),
            &["shapes[1]: the picture as the spectra of its colours, without its illuminant"],
            &[],
        ),
        (
            "media: {m: {homogeneous: {absorption: {rgb: [2, 1, 0.5]}}}}\n",
            BALL,
            &["media.m: its coefficients at every fifth nanometre"],
            &["name=\"sigma_t\" value=\"360:", "name=\"albedo\" value=\"0\""],
        ),
        (
            "media: {m: {homogeneous: {absorption: {scaled: {by: 2, of: {rgb: [1, 0.5, 0.25]}}}}}}\n",
            BALL,
            &["media.m: its coefficients at every fifth nanometre"],
            &["name=\"sigma_t\" value=\"360:", "name=\"albedo\" value=\"0\""],
        ),
        (
            "media: {m: {homogeneous: {extinction: {rgb: [2, 1, 0.5]}, albedo: {scaled: {by: 0.5, of: {rgb: [1, 0.5, 0.25]}}}}}}\n",
            BALL,
            &["media.m: its colour at every fifth nanometre"],
            &["name=\"sigma_t\" value=\"360:", "name=\"albedo\" value=\"360:"],
        ),
        (
            "",
            &card("diffuse: {reflectance: {scaled: {by: 0.5, of: {rgb: [0.9, 0.2, 0.8]}}}}"),
            &["shapes[1].rectangle.material: its colour at every fifth nanometre: Mitsuba has no multiples of one"],
            &["name=\"reflectance\" value=\"360:"],
        ),
        (
            "",
            &card("mirror: {reflectance: {scaled: {by: 0.5, of: {rgb: [0.9, 0.2, 0.8]}}}}"),
            &["shapes[1].rectangle.material: its colour at every fifth nanometre: Mitsuba has no multiples of one"],
            &["name=\"specular_reflectance\" value=\"360:"],
        ),
        (
            "textures: {squares: {checkerboard: {a: {scaled: {by: 0.5, of: {rgb: [0.9, 0.2, 0.8]}}}, b: 0.3}}}\n",
            &card("diffuse: {reflectance: {texture: squares}}"),
            &["textures.squares: its colour at every fifth nanometre: Mitsuba has no multiples of one"],
            &["name=\"color0\" value=\"360:"],
        ),
        (
            "textures: {photo: {image: {file: EARTH}}}\n",
            "sphere: {center: [0, 1, 0], radius: 0.5, emission: {texture: photo}}",
            &["shapes[1]: the same shape with Mitsuba's texture coordinates"],
            &["set textures.photo.image.illuminant: D65"],
        ),
        (
            "lights: [{constant: {radiance: {scaled: {by: 2, of: {scaled: {by: 0.3, of: {illuminant: D65}}}}}}}]\n",
            &grey,
            &[],
            &[],
        ),
        // A table of zeros has "no probability mass" there.
        (
            "lights: [{constant: {radiance: {scaled: {by: 0, of: {illuminant: D65}}}}}, {point: {position: [0, 3, 2], intensity: 5}}]\n",
            &card("diffuse: {reflectance: {table: [[400, 0], [700, 0]]}}"),
            &[],
            &["<spectrum name=\"radiance\" value=\"0\"/>", "<spectrum name=\"reflectance\" value=\"0\"/>"],
        ),
        (
            "lights: [{constant: {radiance: {scaled: {by: 0, of: {table: [[400, 1], [700, 2]]}}}}}, \
             {point: {position: [0, 3, 2], intensity: 5}}]\n",
            &grey,
            &[],
            &["<spectrum name=\"radiance\" value=\"0\"/>"],
        ),
        // So has a black colour.
        (
            "lights: [{constant: {radiance: {rgb: [0, 0, 0]}}}, \
             {point: {position: [0, 3, 2], intensity: {scaled: {by: 0, of: {rgb: [1, 0.5, 0.2]}}}}}]\n",
            "sphere: {center: [0, 1, 0], radius: 0.5, emission: 1}",
            &[],
            &["<spectrum name=\"radiance\" value=\"0\"/>", "<spectrum name=\"intensity\" value=\"0\"/>"],
        ),
        (
            "",
            "cylinder: {base: [0, 0.5, 0], top: [0, 1, 0], radius: 0.2, caps: none, emission: 1, transform: [scale: [-2, 2, 2]]}",
            &[],
            &["<float name=\"radius\" value=\"0.4\"/>"],
        ),
    ];
    for (head, shape, losses, said) in cases {
        let (told, xml) = exported_with(head, shape);
        assert_eq!(told, *losses, "{head}{shape}");
        assert!(said.iter().all(|part| xml.contains(part)), "{head}{shape}: {said:?} in {xml}");
        let for_mitsuba = xml.split("<?abbe").map(|part| part.split_once("?>").map_or(part, |(_, after)| after));
        assert!(for_mitsuba.into_iter().all(|part| !part.contains("flip_normals")), "{xml}");
    }
}
