use super::super::{Material, SceneDescription, TransformStep};
use super::*;

const HEAD: &str =
    "<scene version=\"3.0.0\">\n<sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/></sensor>\n";

/// Reads the scene of [`HEAD`] and, from line 3, `text`.
fn scene(text: &str, defines: &[(&str, &str)]) -> Result<SceneDescription> {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("s.xml");
    std::fs::write(&path, format!("{HEAD}{text}\n</scene>\n")).unwrap();
    let define = |(n, v): &(&str, &str)| Define { name: (*n).to_owned(), value: (*v).to_owned(), place: None };
    let defines: Vec<Define> = defines.iter().map(define).collect();
    let mut sources = Sources::default();
    let root = read(&path, &defines, &mut sources)?;
    SceneDescription::of_tree(root, &path, sources)
}

/// The faults of a scene, without the directory.
pub(super) fn fault(text: &str, defines: &[(&str, &str)]) -> String {
    match scene(text, defines) {
        Ok(_) => "none".to_owned(),
        Err(error) => {
            let text = error.to_string();
            text.lines().map(|line| line.find("s.xml").map_or(line, |at| &line[at..])).collect::<Vec<_>>().join("\n")
        }
    }
}

pub(super) fn good(text: &str) -> SceneDescription {
    scene(text, &[]).unwrap_or_else(|error| panic!("{error}"))
}

/// Mitsuba 3.9.1 gives the same picture, of each step by itself, on shapes, lights, textures and cameras alike.
#[test]
fn the_last_row_of_a_matrix_is_passed_over() {
    let rectangle = |last: &str| {
        format!(
            "<shape type=\"rectangle\"><transform name=\"to_world\"><matrix value=\"1 0 0 0 0 1 0 0 0 0 1 0 {last}\"/>\
             <translate x=\"2\"/></transform></shape>"
        )
    };
    let (affine, projective) = (good(&rectangle("0 0 0 1")), good(&rectangle("0.2 0.1 0 3")));
    assert_eq!(projective.shapes, affine.shapes);
    let said = "the last row of the matrix, [0.2, 0.1, 0, 3], is taken for 0, 0, 0, 1, as in Mitsuba";
    let told = |scene: &SceneDescription| scene.locator.notes().iter().any(|note| note.ends_with(said));
    assert!(told(&projective) && !told(&affine));
}

/// Mitsuba's documentation: `d65` has a `scale` of 1, `hair` an `eumelanin` of 1.3 and a `pheomelanin` of 0.2.
#[test]
fn what_is_not_written_is_what_mitsuba_takes() {
    let float = |name: &str, value: f64| format!("<float name=\"{name}\" value=\"{value}\"/>");
    let lamp = |scale: &str| {
        let light = format!("<spectrum type=\"d65\" name=\"radiance\">{scale}</spectrum>");
        good(&format!("<emitter type=\"constant\">{light}</emitter>")).lights
    };
    assert_eq!(lamp(""), lamp(&float("scale", 1.0)));
    assert_ne!(lamp(""), lamp(&float("scale", 2.0)));
    let hair = |pigments: &str| good(&format!("<bsdf type=\"hair\" id=\"h\">{pigments}</bsdf>")).materials;
    let written = |eumelanin, pheomelanin| hair(&(float("eumelanin", eumelanin) + &float("pheomelanin", pheomelanin)));
    assert_eq!(hair(""), written(1.3, 0.2));
    assert!(hair("") != written(1.3, 0.4) && hair("") != written(2.6, 0.2));
}

#[test]
fn parameters_are_filled_in_anywhere_in_a_value() {
    let text = "<default name=\"r\" value=\"2\"/><default name=\"radius\" value=\"7\"/>\
                <shape type=\"sphere\"><float name=\"radius\" value=\"1$r.5\"/></shape>\
                <shape type=\"sphere\"><float name=\"radius\" value=\"$radius\"/></shape>";
    let radii = |defines: &[(&str, &str)]| -> Vec<f64> {
        let scene = scene(text, defines).unwrap();
        let radius = |shape: &super::super::Shape| match &shape.geometry {
            super::super::Geometry::Sphere(sphere) => sphere.radius,
            other => panic!("{other:?}"),
        };
        scene.shapes.iter().map(radius).collect()
    };
    assert_eq!(radii(&[]), [12.5, 7.0]);
    assert_eq!(radii(&[("r", "3")]), [13.5, 7.0]);
    let unused = fault(text, &[("raduis", "3")]);
    assert_eq!(unused, "s.xml uses, found none named \"raduis\"; did you mean \"radius\"?");
    assert_eq!(
        fault("<shape type=\"sphere\"><float name=\"radius\" value=\"$rad\"/></shape>", &[]),
        "s.xml:3:50: expected a parameter with a <default> or -D rad=…, found $rad without either"
    );
    // A name comes straight after the dollar.
    for (value, found) in [("${rad}", "${rad}"), ("1$ 2", "$ 2"), ("12$", "$")] {
        assert_eq!(
            fault(&format!("<shape type=\"sphere\"><float name=\"radius\" value=\"{value}\"/></shape>"), &[]),
            format!("s.xml:3:50: expected the name of a parameter after $, found \"{found}\"; \\$ is a dollar")
        );
    }
}

/// Mitsuba 3.9.1 takes 4 for the first of these; a number was told that is none, and text stood as it is.
#[test]
fn values_of_parameters_name_no_parameters() {
    let text = "<shape type=\"sphere\"><float name=\"radius\" value=\"$a\"/></shape>";
    for value in ["$b", "2$", "\\$b$"] {
        let told = fault(text, &[("a", value), ("b", "4")]);
        let expected = "expected a value without other parameters, found a $; \\$ is a dollar";
        assert_eq!(told, format!("-D a={value}: {expected}"));
    }
    let named = "<bsdf type=\"diffuse\" id=\"$a\"/>";
    assert!(scene(named, &[("a", "two \\$")]).unwrap().materials.contains_key("two $"));
}

/// As in Mitsuba 3.9.1, where each of these counts as a use.
#[test]
fn parameters_are_used_in_names_and_where_they_are_empty() {
    let named = "<shape type=\"sphere\"><float name=\"$par\" value=\"3\"/></shape>";
    let sphere = |scene: &SceneDescription| match &scene.shapes[0].geometry {
        super::super::Geometry::Sphere(sphere) => sphere.radius,
        other => panic!("{other:?}"),
    };
    assert_eq!(sphere(&scene(named, &[("par", "radius")]).unwrap()), 3.0);
    let look = "<sensor type=\"perspective\"><transform name=\"to_world\">\
                <lookat origin=\"0,0,4\" target=\"0,0,0\" up=\"$up\"/></transform></sensor>";
    assert_eq!(fault(look, &[("up", "")]), "none");
}

#[test]
fn transforms_act_in_the_order_of_the_text() {
    let scene = good(
        "<shape type=\"rectangle\"><transform name=\"to_world\"><translate x=\"1\"/><scale value=\"2\"/>\
         <rotate z=\"1\" angle=\"90\"/><matrix value=\"1 0 0 0 1 0 0 0 1\"/></transform></shape>",
    );
    let [TransformStep::Matrix(rows)] = scene.shapes[0].transform[..] else { panic!("one matrix") };
    // (0, 0, 0) → (1, 0, 0) → (2, 0, 0) → (0, 2, 0).
    assert_eq!([rows[0][3], rows[1][3], rows[2][3]], [0.0, 2.0, 0.0]);
}

#[test]
fn names_before_version_2_are_in_camel_case() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("s.xml");
    let text = "<scene version=\"0.6.0\"><sensor type=\"perspective\"><transform name=\"toWorld\"><translate z=\"1\"/>\
                </transform></sensor><shape type=\"sphere\"><bsdf type=\"dielectric\">\
                <float name=\"intIOR\" value=\"1.7\"/></bsdf></shape></scene>";
    std::fs::write(&path, text).unwrap();
    let mut sources = Sources::default();
    let root = read(&path, &[], &mut sources).unwrap_or_else(|error| panic!("{error}"));
    let scene = SceneDescription::of_tree(root, &path, sources).unwrap();
    let super::super::MaterialRef::Inline(Material::Dielectric(glass)) = &scene.shapes[0].material else {
        panic!("{:?}", scene.shapes[0].material)
    };
    assert_eq!(glass.ior, super::super::Index::Number(1.7));
}

/// Of veach-bidir: numbers of six digits whose axes are off from right angles by 2e-5.
#[test]
fn a_camera_may_be_turned_by_rounded_numbers() {
    let with = |first: &str| {
        let text = format!(
            "<scene version=\"3.0.0\"><sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/>\
             <transform name=\"to_world\"><matrix value=\"{first} -0.00467005 -0.999977 16.2155 \
             0 0.999989 -0.00467011 4.05167 0.999987 -2.34659e-005 -0.00502464 0.0114864 0 0 0 1\"/></transform></sensor></scene>"
        );
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("s.xml");
        std::fs::write(&path, text).unwrap();
        let mut sources = Sources::default();
        let root = read(&path, &[], &mut sources)?;
        SceneDescription::of_tree(root, &path, sources)
    };
    with("-0.00500708").unwrap();
    let sheared = with("-0.00900708").unwrap_err().to_string();
    let told =
        "camera.to_world: expected moves, turns and mirrors for a perspective, found a matrix that scales or shears";
    assert!(sheared.ends_with(told), "{sheared}");
}

/// A turn by 45 degrees of what is 5 cm large, as C's `%f` prints it: 1.4e-5 of the scale away from one, which a note tells. What is
/// stretched by more than a thousandth is refused as ever.
#[test]
fn balls_and_cylinders_may_be_placed_by_six_decimals() {
    let placed = |plugin: &str, z: &str| {
        let rows = format!("0.035355 -0.035355 0 1 0.035355 0.035355 0 2 0 0 {z} 3 0 0 0 1");
        format!("<shape type=\"{plugin}\"><transform name=\"to_world\"><matrix value=\"{rows}\"/></transform></shape>")
    };
    let told = |plugin: &str, z: &str, word: &str| {
        let scene = good(&placed(plugin, z));
        scene.locator.notes().iter().any(|note| note.contains(word))
    };
    assert!(told("sphere", "0.05", "the nearest is taken"));
    assert!(!told("cylinder", "0.05", "its digits"), "columns of like lengths that are at right angles");
    let linear = DMat3::from_mat4(good(&placed("sphere", "0.05")).shapes[0].world_from_object());
    let gram = linear.transpose() * linear;
    let off = (gram - DMat3::IDENTITY * gram.x_axis.x).to_cols_array().map(f64::abs);
    // Scale squared to the half of the sixth decimal, twice over 0.05.
    assert!((gram.x_axis.x / 0.0025 - 1.0).abs() < 2e-5 && off.iter().all(|x| *x < 1e-15), "{gram}");
    let turned = "0.036 -0.035 0 0 0.035 0.036 0.0000251 0 0 0 0.05 0 0 0 0 1";
    let scene = format!(
        "<shape type=\"cylinder\"><transform name=\"to_world\"><matrix value=\"{turned}\"/></transform></shape>"
    );
    assert!(good(&scene).locator.notes().iter().any(|note| note.contains("but for 3.6e-4, its digits")));
    assert!(fault(&placed("sphere", "0.0501"), &[]).contains("expected moves, turns and even scaling"));
}

/// An element that nobody knows is told as that, whatever is in it.
#[test]
fn an_unknown_element_is_one_fault() {
    let told = fault("<camera type=\"perspective\"><float name=\"fov\" value=\"40\"/></camera>", &[]);
    assert!(told.starts_with("s.xml:3:1: expected an element of a scene, found <camera>; known: "), "{told}");
    let told = fault("<float name=\"fov\" value=\"40\"><float name=\"a\" value=\"1\"/></float>", &[]);
    assert!(told.contains("expected nothing inside <float>, found <float>"), "{told}");
}

#[test]
fn an_unknown_plugin_or_parameter_is_one_fault_with_a_near_miss() {
    assert_eq!(
        fault("<shape type=\"spere\"/>", &[]),
        "s.xml:3:14: expected a shape that Abbe has (sphere, cylinder, disk, rectangle, cube, obj, ply, \
         serialized, sdfgrid, linearcurve, bsplinecurve, merge, shapegroup, instance), found \
         \"spere\"; did you mean \"sphere\"?"
    );
    assert_eq!(
        fault("<shape type=\"sphere\"><float name=\"raduis\" value=\"1\"/></shape>", &[]),
        "s.xml:3:22: shape \"sphere\": expected parameters among center, flip_normals, radius, \
         silhouette_sampling_weight, to_world, found \"raduis\"; did you mean \"radius\"?"
    );
    assert_eq!(
        fault("<shape type=\"sphere\"><string name=\"radius\" value=\"1\"/></shape>", &[]),
        "s.xml:3:22: shape \"sphere\": radius: expected a float, found the string \"1\""
    );
    assert_eq!(
        fault(
            "<shape type=\"sphere\"><float name=\"radius\" value=\"1\"/><float name=\"radius\" value=\"1\"/></shape>",
            &[]
        )
        .split("; it is")
        .next()
        .unwrap(),
        "s.xml:3:54: expected each parameter once, found \"radius\" again"
    );
    assert_eq!(
        fault("<shap type=\"sphere\"/>", &[]),
        "s.xml:3:1: expected an element of a scene, found <shap>; did you mean \"shape\"?"
    );
    assert_eq!(
        fault("<group/>", &[]),
        "s.xml:3:1: expected an element of a scene, found <group>; known: integrator, sensor, film, rfilter, \
         sampler, shape, bsdf, emitter, medium, phase, texture, volume, float, integer, boolean, string, point, vector, \
         rgb, spectrum, transform, ref, alias, default, include, path"
    );
    assert_eq!(
        fault("<scene type=\"scene\"><shape type=\"cube\"/></scene>", &[]),
        "s.xml:3:1: expected <scene> around all others, found it inside"
    );
    assert_eq!(
        fault("<shape typ=\"sphere\"/>", &[]),
        "s.xml:3:13: expected attributes among type, id, name in <shape>, found \"typ\"; did you mean \"type\"?"
    );
}

#[test]
fn a_film_without_pixels_is_told_at_its_side() {
    let told = |width: u32, height: u32| {
        let film =
            format!("<integer name=\"width\" value=\"{width}\"/>\n<integer name=\"height\" value=\"{height}\"/>");
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("s.xml");
        let head = HEAD.replace("</sensor>", "<film type=\"hdrfilm\">");
        std::fs::write(&path, format!("{head}{film}</film></sensor></scene>")).unwrap();
        let mut sources = Sources::default();
        let root = read(&path, &[], &mut sources).unwrap();
        SceneDescription::of_tree(root, &path, sources).unwrap_err().to_string()
    };
    let expected = "expected a whole number from 1 to 65536, found";
    for (told, ending) in [(told(0, 8), "s.xml:3:1: image.width: "), (told(8, 65537), "s.xml:4:1: image.height: ")] {
        assert!(told.contains(&format!("{ending}{expected}")), "{told}");
    }
}

/// Mitsuba 3.9.1 lowers the letters of some words and not of others.
#[test]
fn words_may_be_in_capitals_where_they_may_for_mitsuba() {
    let metal = |word: &str| {
        let metal = format!("<bsdf type=\"roughconductor\"><string name=\"distribution\" value=\"{word}\"/></bsdf>");
        format!("<shape type=\"sphere\">{metal}</shape>")
    };
    assert_eq!(good(&metal("GGX")).shapes, good(&metal("ggx")).shapes);
    let film = "<sensor type=\"perspective\"><float name=\"fov\" value=\"30\"/><string name=\"fov_axis\" value=\"Larger\"/>\
                <film type=\"hdrfilm\"><string name=\"pixel_format\" value=\"RGBA\"/><string name=\"file_format\" value=\"OpenEXR\"/>\
                <string name=\"component_format\" value=\"Float32\"/></film></sensor>";
    good(film);
    let texture = "<texture type=\"bitmap\" id=\"t\"><string name=\"filename\" value=\"a.png\"/>\
                   <string name=\"wrap_mode\" value=\"Clamp\"/></texture>";
    assert!(fault(texture, &[]).contains("wrap_mode: expected one of repeat, mirror, clamp, found \"Clamp\""));
    assert!(fault(&metal("phong"), &[]).contains("distribution: expected one of beckmann, ggx, found \"phong\""));
}

#[test]
fn how_a_picture_is_kept_makes_no_difference() {
    let texture = |id: &str, format: &str| {
        let file = "<string name=\"filename\" value=\"a.png\"/>";
        format!("<texture type=\"bitmap\" id=\"{id}\">{file}{format}</texture>")
    };
    for format in ["auto", "variant", "float16", "fp16", "uint8"] {
        let format = format!("<string name=\"format\" value=\"{format}\"/>");
        let scene = good(&(texture("kept", &format) + &texture("plain", "")));
        assert_eq!(scene.textures["kept"], scene.textures["plain"], "{format}");
    }
}

#[test]
fn what_has_no_name_is_told_by_what_it_is() {
    let ball = |part: &str| fault(&format!("<shape type=\"sphere\">{part}</shape>"), &[]);
    assert_eq!(
        ball("<float name=\"\" value=\"1\"/>"),
        "s.xml:3:22: shape \"sphere\": expected a name, found a float without one"
    );
    assert_eq!(
        ball("<sampler type=\"independent\"/>"),
        "s.xml:3:22: shape \"sphere\": expected no sampler \"independent\""
    );
}

#[test]
fn sensors_after_the_first_are_noted() {
    assert_eq!(good("<shape type=\"sphere\"/>").locator.notes(), [""; 0]);
    let turned = "<shape type=\"cube\"><transform name=\"to_world\"><rotate AXIS angle=\"9\"/></transform></shape>";
    assert_eq!(good(&turned.replace("AXIS", "x=\"0.6\" y=\"0.8\"")).locator.notes(), [""; 0]);
    let notes = good(&turned.replace("AXIS", "x=\"1\" y=\"1\"")).locator.notes();
    assert!(
        notes.len() == 1
            && notes[0].contains("s.xml:3:47: expected an axis of length 1 in <rotate>, found one of 1.4142"),
        "{notes:?}"
    );
    let notes = good("<sensor type=\"perspective\"/>\n<sensor type=\"perspective\"/>").locator.notes();
    let told: Vec<&str> = notes.iter().map(|note| &note[note.find("s.xml").unwrap()..]).collect();
    assert!(
        told[0].starts_with("s.xml:3:1: sensor: it is passed over, for the first one takes the picture, at "),
        "{told:?}"
    );
    assert!(told[1].starts_with("s.xml:4:1: ") && told[1].ends_with("s.xml:2:1") && told.len() == 2, "{told:?}");
}

#[test]
fn references_are_checked() {
    assert_eq!(
        fault("<bsdf type=\"diffuse\" id=\"grey\"/>\n<shape type=\"sphere\"><ref id=\"gray\"/></shape>", &[]),
        "s.xml:4:22: expected the id of an object, found \"gray\"; did you mean \"grey\"?"
    );
    assert!(
        fault("<bsdf type=\"diffuse\" id=\"a\"/>\n<bsdf type=\"diffuse\" id=\"a\"/>", &[])
            .starts_with("s.xml:4:1: expected each id once, found \"a\" again; it is first at ")
    );
    assert_eq!(
        fault(
            "<bsdf type=\"twosided\" id=\"a\"><ref id=\"b\"/></bsdf>\n<bsdf type=\"twosided\" id=\"b\"><ref id=\"a\"/></bsdf>",
            &[]
        ),
        "s.xml:4:30: expected an object that does not hold itself, found a circle of references"
    );
    let scene = good(
        "<bsdf type=\"diffuse\" id=\"a\"/><alias id=\"a\" as=\"b\"/><shape type=\"sphere\"><ref id=\"b\"/></shape>\
         <shape type=\"sphere\"><ref id=\"a\" name=\"bsdf\"/></shape>",
    );
    assert_eq!(scene.materials.len(), 1);
    assert_eq!(scene.shapes[0].material, scene.shapes[1].material);
}

/// One list of ids makes several lists of names, of which none has a name twice.
#[test]
fn names_that_are_made_are_nobodys_id() {
    let grey = |id: &str, value: &str| {
        format!("<bsdf type=\"diffuse\" id=\"{id}\"><float name=\"reflectance\" value=\"{value}\"/></bsdf>")
    };
    let scene = good(&(grey("m", "0.1") + &grey("m (bsdf)", "0.9") + "<shape type=\"sphere\"><ref id=\"m\"/></shape>"));
    let super::super::MaterialRef::Name(name) = &scene.shapes[0].material else { panic!("a name") };
    let Material::Diffuse(diffuse) = &scene.materials[name] else { panic!("diffuse") };
    assert_eq!(diffuse.reflectance, super::super::SpectrumOrTexture::Spectrum(super::super::Spectrum::Number(0.1)));
    // Where another kind has the name, or nothing, the kind is taken away as ever.
    let scene = good(&("<texture type=\"checkerboard\" id=\"n\"/>".to_owned() + &grey("n (bsdf)", "0.1")));
    assert!(scene.materials.contains_key("n") && scene.textures.contains_key("n"));

    // The unnamed ones are objects 8 and 10 of the file: the scene is 0, the sensor 1.
    let board = |id: &str, value: &str| {
        format!("<texture type=\"checkerboard\" {id}><float name=\"color0\" value=\"{value}\"/></texture>")
    };
    let rough = |board: &str| format!("<shape type=\"sphere\"><bsdf type=\"roughconductor\">{board}</bsdf></shape>");
    let named = board("id=\"checkerboard 8\"", "0.1") + &board("id=\"checkerboard 8 as numbers\"", "0.3");
    let unnamed = board("name=\"specular_reflectance\"", "0.5") + &board("name=\"alpha\"", "0.7");
    let more = "<texture type=\"checkerboard\" id=\"checkerboard 7 as numbers\"/>\
                <texture type=\"checkerboard\" id=\"checkerboard 7\"/>";
    let scene = good(&(named + more + &rough(&unnamed)));
    // Four with ids and two without.
    assert_eq!(scene.textures.len(), 6, "{:?}", scene.textures.keys());

    let group = |id: &str| format!("<shape type=\"shapegroup\" {id}><shape type=\"sphere\"/></shape>");
    let instance = |group: &str| format!("<shape type=\"instance\">{group}</shape>");
    let scene = good(&(group("id=\"shapegroup 5\"") + &instance(&group("")) + &instance("<ref id=\"shapegroup 5\"/>")));
    assert_eq!(scene.groups.len(), 2, "{:?}", scene.groups.keys());
}

/// Mitsuba 3.9.1 renders both as if neither the group nor its copies were there; they have to hold all the same.
#[test]
fn copies_of_an_empty_group_are_not_seen() {
    let group = "<shape type=\"shapegroup\" id=\"g\"/>";
    let copy = "<shape type=\"instance\"><ref id=\"g\"/></shape>";
    let counts = |text: &str| {
        let scene = good(text);
        (scene.groups.len(), scene.shapes.len())
    };
    assert_eq!(counts(group), (0, 0));
    assert_eq!(counts(&format!("{group}{copy}{copy}<shape type=\"sphere\"/>")), (0, 1));
    let merge = "<shape type=\"shapegroup\" id=\"g\"><shape type=\"merge\"/></shape>";
    assert_eq!(counts(&format!("{merge}{copy}")), (0, 0));
    let wrong = copy.replace("/></shape>", "/><float name=\"gg\" value=\"1\"/></shape>");
    assert!(fault(&format!("{group}{wrong}"), &[]).contains("found \"gg\""));
}

/// As Mitsuba has it: what is a part of another object may stand in the scene, to be named from there.
#[test]
fn parts_of_others_may_stand_in_the_scene() {
    let parts = "<phase type=\"hg\" id=\"p\"/><spectrum type=\"d65\" id=\"v\"/><film type=\"hdrfilm\" id=\"f\"/>\
                 <sampler type=\"independent\" id=\"s\"/><rfilter type=\"box\" id=\"r\"/>\
                 <medium type=\"homogeneous\"><ref id=\"p\"/></medium><emitter type=\"constant\"><ref name=\"radiance\" id=\"v\"/></emitter>\
                 <sensor type=\"perspective\"><ref id=\"f\"/><ref id=\"s\"/></sensor>";
    let scene = good(parts);
    assert_eq!((scene.media.len(), scene.lights.len(), scene.textures.len()), (1, 1, 0));
    let wrong = "<phase type=\"hg\" id=\"p\"><float name=\"gg\" value=\"1\"/></phase>";
    assert!(fault(wrong, &[]).contains("phase \"hg\": expected parameters among g, found \"gg\""));
}

/// Each is an error for Mitsuba 3.9.1, too.
#[test]
fn what_mitsuba_refuses_is_refused() {
    let sensor = |text: &str| fault(&format!("<sensor type=\"perspective\">{text}</sensor>"), &[]);
    let float = |name: &str, value: &str| format!("<float name=\"{name}\" value=\"{value}\"/>");
    let told = sensor(&float("near_clip", "0"));
    assert_eq!(told, "s.xml:3:28: sensor \"perspective\": near_clip: expected a number above 0, found 0");
    let told = sensor(&float("shutter_open", "1"));
    assert!(told.ends_with("shutter_close: expected at least shutter_open, 1, found 0"), "{told}");
    let told = sensor("<string name=\"focal_length\" value=\"50mm\"/><string name=\"fov_axis\" value=\"y\"/>");
    assert!(told.ends_with("fov_axis: expected it beside fov, found it without"), "{told}");
    let told =
        sensor(&format!("<film type=\"hdrfilm\"><rfilter type=\"lanczos\">{}</rfilter></film>", float("lobes", "3")));
    assert!(told.ends_with("lobes: expected an integer, found a float"), "{told}");
    let told = sensor("<film type=\"hdrfilm\"><integer name=\"width\" value=\"+32\"/></film>");
    assert!(told.ends_with("expected a whole number, found \"+32\""), "{told}");

    let sky = |radiance: &str| format!("<emitter type=\"constant\">{radiance}</emitter>");
    let told = fault(&sky("<spectrum type=\"uniform\" name=\"radiance\"/>"), &[]);
    assert!(told.ends_with("expected the parameter \"value\", found none"), "{told}");
    let told = fault(&sky("<spectrum name=\"radiance\" value=\"500:0.3\"/>"), &[]);
    assert!(told.ends_with("expected two pairs or more, found \"500:0.3\""), "{told}");
    let told = fault(&format!("{}\n{}", sky(""), sky("")), &[]);
    assert_eq!(told, "s.xml:4:1: emitter \"constant\": expected one environment, found another");
    let lit = "<shape type=\"sphere\"><ref id=\"a\"/></shape>";
    let told = fault(&format!("<shape type=\"sphere\"><emitter type=\"area\" id=\"a\"/></shape>\n{lit}"), &[]);
    assert_eq!(told, "s.xml:4:1: expected an emitter of its own, found one that another shape has");
}

/// A chain of references is as deep as nested elements, and has its limit.
#[test]
fn a_long_chain_of_references_is_one_fault() {
    let mut text = String::from("<bsdf type=\"diffuse\" id=\"b0\"/>");
    for i in 1..10_000 {
        text.push_str(&format!("<bsdf type=\"twosided\" id=\"b{i}\"><ref id=\"b{}\"/></bsdf>", i - 1));
    }
    assert!(fault(&text, &[]).ends_with("expected at most 64 objects within one another, found more"));
}

/// Each of 60 names the one before twice: 2⁶⁰ objects, were they all written out, or as many looks.
#[test]
fn references_do_not_multiply_without_end() {
    let chain = |first: &str, next: &dyn Fn(usize, String) -> String| {
        let twice = |i: usize| format!("<ref id=\"o{i}\"/>").repeat(2);
        (1..=60).fold(first.to_owned(), |text, i| text + &next(i, twice(i - 1)) + "\n")
    };
    let expected = "expected at most 4000000 values that references write out again, found more";
    let phases = chain("<phase type=\"isotropic\" id=\"o0\"/>", &|i, twice| {
        format!("<phase type=\"blendphase\" id=\"o{i}\"><float name=\"weight\" value=\"0.5\"/>{twice}</phase>")
    });
    let merges = chain("<shape type=\"sphere\" id=\"o0\"/>", &|i, twice| {
        format!("<shape type=\"merge\" id=\"o{i}\">{twice}</shape>")
    });
    let layers = chain("<integrator type=\"path\" id=\"o0\"/>", &|i, twice| {
        format!("<integrator type=\"aov\" id=\"o{i}\"><string name=\"aovs\" value=\"\"/>{twice}</integrator>")
    });
    // Of a scene's integrators there is one.
    let layers = format!("<integrator type=\"moment\">{layers}<ref id=\"o60\"/></integrator>");
    for text in [phases, merges, layers] {
        assert!(fault(&text, &[]).ends_with(expected), "{}", fault(&text, &[]));
    }
    let materials = chain("<bsdf type=\"diffuse\" id=\"o0\"/>", &|i, twice| {
        format!("<bsdf type=\"blendbsdf\" id=\"o{i}\"><float name=\"weight\" value=\"0.5\"/>{twice}</bsdf>")
    });
    // Materials go by name, but for what a look-up would take.
    let both = format!("{materials}<bsdf type=\"twosided\"><ref id=\"o60\"/></bsdf>");
    let told = fault(&both, &[]);
    assert!(told.ends_with("expected at most 4096 layers and materials, found more"), "{told}");
}

/// Each doubles the one before.
#[test]
fn parameters_do_not_multiply_without_end() {
    let bomb: String = (1..60).map(|i| format!("<default name=\"a{i}\" value=\"$a{j}$a{j}\"/>\n", j = i - 1)).collect();
    let told = fault(&format!("<default name=\"a0\" value=\"xy\"/>\n{bomb}"), &[]);
    let expected = ": expected parameters of at most 67108864 bytes in all their places, found more";
    assert!(told.starts_with("s.xml:2") && told.ends_with(expected), "{told}");
}

/// As Mitsuba 3.9.1 finds them: spectra at once, by each `<path>` above, in included files beside the file that includes
/// first; all else when everything is read, by each `<path>` of the scene's file alone. Of what it does not find, some is
/// found besides.
#[test]
fn files_are_looked_for_where_mitsuba_looks() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    std::fs::create_dir_all(at("sub")).unwrap();
    for name in ["a.obj", "sub/a.obj", "sub/b.obj", "q.spd", "sub/q.spd"] {
        std::fs::write(at(name), "").unwrap();
    }
    let obj = |name: &str| format!("<shape type=\"obj\"><string name=\"filename\" value=\"{name}\"/></shape>");
    let paint = "<bsdf type=\"diffuse\"><spectrum name=\"reflectance\" filename=\"q.spd\"/></bsdf>";
    let path = |name: &str| format!("<path value=\"{name}\"/>");
    let include = "<include filename=\"sub/in.xml\"/>";
    let write = |name: &str, inner: &str| {
        std::fs::write(at(name), format!("<scene version=\"3.0.0\">{inner}</scene>")).unwrap();
    };
    let found = |scene: &str, included: &str| -> Vec<String> {
        write("sub/in.xml", included);
        write("s.xml", scene);
        let document = parse::read(&at("s.xml"), &[], &mut Sources::default()).unwrap();
        let mut found = Vec::new();
        for object in &document.objects {
            found.extend(object.properties.iter().filter_map(|property| match &property.value {
                object::Value::Text(name) => Some(document.find(name, object.source)),
                object::Value::Spectrum(object::SpectrumValue::File(path)) => Some(path.clone()),
                _ => None,
            }));
        }
        let root = directory.path().canonicalize().unwrap();
        let within = |path: &String| {
            let path = Path::new(path).canonicalize().unwrap();
            path.strip_prefix(&root).unwrap().to_str().unwrap().replace('\\', "/")
        };
        found.iter().map(within).collect()
    };
    let both = paint.to_owned() + &obj("a.obj");
    assert_eq!(found(&(paint.to_owned() + &path("sub") + &both), ""), ["q.spd", "sub/q.spd", "sub/a.obj"]);
    assert_eq!(found(&(both.clone() + &path("sub")), ""), ["q.spd", "sub/a.obj"]);
    assert_eq!(found(include, &both), ["q.spd", "a.obj"]);
    assert_eq!(found(&(path("sub") + include), &both), ["q.spd", "sub/a.obj"]);
    // A <path> of an included file ends with it.
    let with_path = path(".") + &both + &obj("b.obj");
    assert_eq!(found(&(include.to_owned() + &both), &with_path), ["sub/q.spd", "a.obj", "sub/b.obj", "q.spd", "a.obj"]);
}
