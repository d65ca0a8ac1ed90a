//! What a person wrote: YAML scenes and batches, read, checked, and not yet compiled.
//!
//! Names stay names, degrees stay degrees, files stay closed. [`load`] reads a batch or a scene;
//! [`BatchEntry::scene`] gives a [`SceneDescription`] that has passed validation.
//!
//! # Conventions
//! y is up, lengths are metres, frames are right-handed, angles are degrees. Colours are linear
//! Rec. 709, spectra are functions of wavelength in nm. A *kind* is a map with one key,
//! `sphere: {radius: 1}`; a kind that needs no fields may stand alone, `filter: mitchell`. A field
//! without value, `fog:` or `fog: null`, is not written. Anchors, aliases and `<<` work; tags do
//! not. A path of a file starts from the file in which it is written, on the command line from
//! the working directory.
//!
//! # A scene, with every field
//! Only `camera` is required, and of each kind the fields that are not said to have a default.
//!
//! ```yaml
//! # scene
//! include: []                       # files that hold materials, textures, volumes, media; each is read once
//! camera:
//!   origin: [0, 3.2, 12]
//!   target: [0, 1.1, 0]
//!   up: [0, 1, 0]                   # default
//!                                   # or, for the three, to_world: four rows of a matrix: the camera looks along +z,
//!                                   # +x is right and +y up in the picture
//!   fov_deg: 38                     # either this, between 0 and 180, or orthographic_height: 4 (m)
//!   fov_axis: x                     # x (default), y, smaller, larger, diagonal
//!   lens: {radius: 0.05, focus_distance: 10}    # default none
//!   clip: {near: 0}                 # ~ near 0, far without end; along the line of sight, m; rays begin at near
//!   principal_point: [0, 0]         # default; where the line of sight meets the picture, from its middle to the
//!                                   # right and down, in widths and heights
//!   shutter: ~                      # for how much of a frame light is taken, around the frame: 0.5 (180°), at most 8; or
//!                                   # {open: -0.25, close: 0.25, moments: ~}: in frames, and at how many moments the scene
//!                                   # is looked at, ~ by what moves
//! image:
//!   width: 600                      # default; 1 to 65536
//!   height: 600                     # default
//!   filter: box                     # default; or one of
//!                                   #   {tent: {radius: 1}}, {gaussian: {stddev: 0.5}}, mitchell (b and c
//!                                   #   default 1/3, -2 to 2), catmull_rom, {lanczos: {radius: 3}}; whitted takes none
//!   crop: {x: 0, y: 0, width: 10, height: 10}   # default all; x and y default 0
//!   overscan: 0                     # default; pixels that are rendered beyond each edge of the frame, without a crop;
//!                                   #   PNGs end at the frame
//!   sample_border: true             # default; false: the filter is cut where the picture ends, and takes no light from beyond
//!   bands: []                       # ~ the OpenEXR file holds bands of the spectrum instead of colour:
//!                                   #   {name: blue, response: SPECTRUM}: ∫ radiance · response dλ, nm,
//!                                   #   whatever the sensitivity; its error is that of the bands
//!   sensitivity: 1                  # default; factor on colours: of the picture, of layers of light, of the PNG
//! integrator: path                  # default; or, with their defaults,
//!                                   #   {path: {max_depth: null, roulette_depth: 5, hide_emitters: false,
//!                                   #           light_samples: 1, scatter_samples: 1, count_crossings: false,
//!                                   #           opaque_sky: false, coverage: surfaces, delta_caustics: true}},
//!                                   #   {light_tracer: {max_depth: null, roulette_depth: 5,
//!                                   #                   hide_emitters: false, count_crossings: false}}: from the
//!                                   #           lights to the camera
//!                                   #   {whitted: {max_depth: 10, grid: 2, ambient: 0,
//!                                   #              transparent_shadows: false}}: rectangles, disks and balls shine from
//!                                   #           their middle, other lamps from 60 points; transparent_shadows: light goes
//!                                   #           straight through glass, dimmed as by a plate,
//!                                   #   depth: the distance to the first surface, m, as light that is even over the spectrum: Y
//!                                   #           is it, red, green and blue are 1.2, 0.95 and 0.91 of it; none: black
//!                                   # max_depth of a path counts segments: 1 emission, 2 direct light;
//!                                   # hide_emitters: lights that the camera sees itself are left out, with the shapes that
//!                                   # shine; by light_tracer their light alone, as by Mitsuba's ptracer;
//!                                   # light_samples, scatter_samples: each sample follows as many whole paths as the
//!                                   # greater says; 0: without shadow rays, or without light met by scattering
//!                                   # coverage: what alpha counts: surfaces and media, not holes and boundaries; or media and
//!                                   # what light is scattered by, of panes what they mirror (scattering); or the first thing
//!                                   # of any kind (first_hit); of media what they scatter or absorb
//!                                   # delta_caustics: mirrors, glass and the coats of plastics throw the light of points, spots,
//!                                   # projectors and directional lights, too, which path tracers do not meet (false in
//!                                   # Mitsuba's XML)
//! layers:                           # further channels of the OpenEXR file, each name.COMPONENT; default none
//! - {name: nn, surface: shading_normal}         # of the first surface: depth (T), position (X, Y, Z), uv (U, V),
//!                                   # geometric_normal, shading_normal, dp_du, dp_dv (X, Y, Z), duv_dx, duv_dy (U, V),
//!                                   # albedo (R, G, B), primitive, shape (I). duv_dx, duv_dy are what u and v change by over
//!                                   # 1/√samples of a pixel to the right and down, as in Mitsuba
//! - {name: direct, light: {path: {max_depth: 2}}, form: rgba, squares: false}
//!                                   # light: ~ of the picture, path, depth, none; ~ form rgba, xyz; ~ squares: the mean
//!                                   # of squares as m2_direct.R, …, or under squares_name
//! - {name: key_diffuse, ways: [diffuse], light_group: key}      # of the light of `path` what came these ways (~ all)
//!                                   # from lamps of this group (~ all). Emission: the camera sees the lamp; caustic: a
//!                                   # mirror, or glass or metal of an alpha below 0.05, threw it onto something else; other light direct (scattered
//!                                   # once) or indirect, by what the camera sees: diffuse, glossy, transmission, media;
//!                                   # both: diffuse_direct, … . emission, caustic, direct, indirect add up to the picture,
//!                                   # and so do emission, caustic, diffuse, glossy, transmission, media
//! - diffuse                         # or a name that says all: a way; light_groups: light_key, …, and light_default of
//!                                   # lamps in no group and of depth fog; Z (depth along the line of sight, where there is nothing
//!                                   # 1e10, or more beyond larger scenes), P, uv, motion (X to the right, Y up, in pixels,
//!                                   # until the next frame): of the ray through the middle of the pixel, not filtered; normal, albedo (in daylight; of metal at
//!                                   # normal incidence, of clear glass 1): means over it, of what is seen, not of holes;
//!                                   # variance, stderr: of the pixel's mean, or of each of its bands; sampleCount;
//!                                   # crypto_object, crypto_material, crypto_asset: Cryptomatte
//! render:                           # these are the defaults
//!   samples: 64                     # paths per pixel
//!   stop: {error: ~, time: ~, samples: ~}       # the first that is reached ends the render: relative RMSE of the picture (0.01, 1%),
//!                                   # wall time of rendering (60, 90s, 10m, 2h), paths per pixel (65536 where another
//!                                   # is given, 256 of a picture that stays black where error alone is);
//!                                   # without any: after `samples`, for which techniques are planned anyway
//!   seed: 0
//!   effects: auto                   # auto, all: the same picture
//!   tile: 32                        # pixels
//!   wavelengths: auto               # auto, visible, uniform
//!   techniques: {light_tracing: auto, packets: auto, merging: auto, reuse: auto, splatting: auto, shadow_rays: auto, even_sky: auto, equiangular: auto, glints: auto, adaptive: auto}
//!                                   # auto, on, off: light of mirrors and glass traced from the lights, wavelengths that
//!                                   # part followed together, photons collected where that light is seen in mirrors and
//!                                   # through glass, indirect light shared by pixels near each other, samples that
//!                                   # count for all pixels whose filters hold them; auto or 1 to 8 shadow rays from the
//!                                   # first vertex of a path; shadow rays to `constant` lights, which rays that leave the
//!                                   # scene meet anyway; distances in media drawn toward lamps; lamps that mirrors and
//!                                   # glass show in less than a few pixels searched, and looked for by themselves; more
//!                                   # samples where the picture is noisier at about the same mean
//!                                   # (auto: where an error or a time ends the render)
//!   frames: ~                       # which, where values change over frames: 12, 1-100, 1-100x5, 1-10,20,30-40
//!   seed_per_frame: true            # the frame is added to the seed, so that noise does not stand still
//!   frames_per_second: ~            # for those who show the pictures
//! output:                           # these are the defaults
//!   dir: out                        # from the working directory; {scene}, and {frame:04}, %04d or #### stand for scene and
//!                                   # frame
//!   exr: {precision: half, compression: zips, stderr: false, channels: rgba, layout: single, dwa_level: 45,
//!         attributes: {}, aces_container: false}     # half, float; none, zips, zip, piz, and with loss dwaa, dwab;
//!                                   # stderr: standard errors of colours and of bands, stderr.R, stderr.NAME;
//!                                   # rgba, rgb, xyza, xyz, luminance_alpha, luminance; single, multipart: each layer in
//!                                   # a part of its own; attributes of the header by name, text or numbers, such as
//!                                   # {owner: us, timeCode: "01:00:00:00"} (of frame 0; where frames_per_second is not
//!                                   # written, 30 frames are a second): standard ones of OpenEXR by their types, other
//!                                   # numbers int where they are whole and fit, else double
//!   spectral: ~                     # or {bands: 31, from_nm: 400, to_nm: 700}: a further file, NAME.spectral.exr, of mean
//!                                   # radiance in bands (layout 1.0 of Fichet, Pacanowski and Wilkie); ~ from 400 to 700;
//!                                   # 0.01 nm wide at the least
//!   png:
//!     exposure: 0                   # stops, or auto: the log-average luminance of the picture, without its darkest 20 and
//!                                   # brightest 2 %, is shown as 0.18; the report and the PNG say how many stops that are
//!     tonemap: aces                 # aces, agx, reinhard: with colours that the display lacks brought within its gamut;
//!                                   # none: numbers of the OpenEXR file, cut
//!     white_balance: none           # the light that is shown white, by Bradford adaptation: {illuminant: A}, 2850 (K, of a
//!                                   # black body), [0.44, 0.41] (x, y), auto: all lights together, by their power
//!     space: srgb                   # srgb, display_p3
//!     bits: 8                       # 8, 16
//!     dither: hash                  # hash, ordered, none
//!   colour: rec709                  # rec709, acescg, aces2065-1, rec2020, p3, xyz
//!   contact_sheet: true             # whether the picture is on the contact sheet of its batch, contact-sheet.png and
//!                                   # contact-sheet.html, which two pictures or more have
//! textures:
//!   earth: {image: {file: earth.jpg, wrap: repeat, filter: bilinear, scale: [1, 1], offset: [0, 0], raw: false}}
//!                                   # repeat, mirror, clamp, and wrap_v where it differs; bilinear, nearest; all but
//!                                   # file default; uv: [[a, b, c], [d, e, f]] maps u, v before scale and offset;
//!                                   # illuminant: {name: D65, scale: 1} multiplies its colours where it shines (~ this,
//!                                   # of measured radiance none)
//!   marble: {volume: haze}          # a volume where it is cut by the surface
//!   rust: {mesh_attribute: {name: vertex_color, scale: 1}}   # numbers of the .ply file of the mesh; ~ scale
//!   floor: {checkerboard: {a: 0.1, b: {rgb: [0.9, 0.8, 0.7]}, scale: [12, 12]}}   # scale default [1, 1]
//!                                   # a and b may be textures; uv as above. Where it shines, {rgb: …} is light with the spectrum of
//!                                   # that reflectance, up to 1, without the D65 that pictures have and {rgb: …} as an emission
//! volumes:
//!   haze: {constant: {value: 0.5, transform: [{scale: 2}]}}
//!                                   # transform as of shapes, from the unit cube; default none
//!   # plume: {grid: {file: plume.vol, filter: trilinear, wrap: clamp, raw: false, file_box: false, above_one: false}}
//!                                   # and transform; all but file default; trilinear, nearest; wrap as of textures, by which it
//!                                   # goes on beyond its cube as far as the box along the world's axes around that
//! materials:                        # ~ marks defaults
//!   clay:
//!     diffuse:
//!       reflectance: {texture: floor}            # spectrum or texture, 0 to 1; ~ 0.5
//!       highlight: {strength: 0.5, exponent: 50, model: blinn}   # whitted only; ~ none; of its fields ~ all; blinn, phong
//!       two_sided: true                          # ~
//!   ring:
//!     conductor:
//!       metal: gold                              # either this, or file: Au.yml, or eta: SPECTRUM and k: SPECTRUM;
//!                                                # 43 names, told where one is unknown
//!       tint: 1                                  # ~ or a texture
//!       roughness: 0                             # ~ microfacet α, 0 is smooth; a number, {texture: name}, or
//!                                                # {u: 0.1, v: 0.3} of these: along ∂p/∂u and across
//!       distribution: ggx                        # ~ ggx, beckmann
//!       fresnel: exact                           # ~ exact, schlick
//!       film: {ior: 2.5, thickness_nm: 45}       # ~ none; a thin film, see below; and highlight, two_sided
//!   silvered: {mirror: {reflectance: 0.9}}       # ~ and highlight
//!   flint:
//!     dielectric:
//!       ior: {glass: N-SF11}                     # an index, see below
//!       exterior_ior: 1                          # ~ and roughness, distribution, fresnel, highlight
//!       reflection_tint: 1                       # ~ factors, or textures
//!       transmission_tint: 1
//!       priority: 2                              # ~ none; see below; and film
//!       absorption: {color: 0.9, at: 0.05}       # ~ by the k of the file of ior, if it has one; or {file: F.yml}, none:
//!                                                # what a way of 0.05 m leaves of white light, spectrum above 0 to 1
//!   pane: {thin_dielectric: {ior: 1.5, exterior_ior: 1}}             # and both tints; thickness_nm: ~ none; with one
//!                                                # the sheet is a film that stands free: a soap bubble
//!   lacquer: {plastic: {reflectance: 0.5, ior: 1.5, exterior_ior: 1, roughness: 0, tint: 1}}
//!                                                # ~ and nonlinear: false, distribution, highlight, two_sided;
//!                                                # roughness is a number;
//!                                                # diffuse_mean: integral (~), nodes: how a rough coat's diffuse
//!                                                # reflectance from inside is taken, nodes as in Mitsuba 3
//!   paint:
//!     principled:                                # Burley's, as in Mitsuba 3; numbers are 0 to 1, or {texture: name},
//!                                                # which specular, eta and sampling do not take
//!       base_color: {rgb: [0.8, 0.3, 0.1]}       # spectrum or texture; ~ 0.5
//!       roughness: 0.4                           # ~ 0.5; α is its square
//!       anisotropic: 0                           # ~ highlights longer along ∂p/∂u
//!       metallic: 0                              # ~
//!       spec_trans: 0                            # ~ light enters; the back is then another side
//!       specular: 0.5                            # ~ reflectance 0.08 specular; or eta: 1.5, the index
//!       spec_tint: 0                             # ~ reflection takes the hue of the base
//!       sheen: 0.2                               # ~ 0; up to 10
//!       sheen_tint: 0                            # ~
//!       flatness: 0                              # ~ diffusion looks like subsurface scattering
//!       clearcoat: 0.5                           # ~ 0; up to 10
//!       clearcoat_gloss: 0                       # ~
//!       luminance: colour                        # ~ what the base is divided by for a tint: its luminance; or
//!                                                # mitsuba, as its spectral modes estimate it (0.38 of white)
//!       sampling: {specular: 1, clearcoat: 1, diffuse: 1}          # ~ how often lobes are sampled, specular above 0
//!       two_sided: true                          # ~ without spec_trans
//!   petal: {principled_thin: {base_color: 0.5, roughness: 0.5, spec_trans: 0, diff_trans: 1, eta: 1.5}}
//!                                                # a sheet; ~ all, but diff_trans is 0 by default, and up to 2,
//!                                                # where all diffuse light crosses; numbers may be textures; and as
//!                                                # above anisotropic, spec_tint, sheen, sheen_tint, flatness,
//!                                                # luminance, sampling: {reflection: 1, transmission: 1,
//!                                                # diffuse_reflection: 1, diffuse_transmission: 1}
//!   fur:
//!     hair:                                      # for curves and cylinders: fibres along ∂p/∂v
//!       eumelanin: 1.3                           # ~ pigments; or absorption: SPECTRUM, times the fibre's radius
//!       pheomelanin: 0.2                         # ~
//!       ior: 1.55                                # ~
//!       exterior_ior: 1                          # ~
//!       roughness_along: 0.3                     # ~ 0.01 to 1
//!       roughness_around: 0.3                    # ~
//!       tilt_deg: 2                              # ~ of the scales toward the root
//!   edge: {boundary: {}}                         # only bounds a medium
//!   leaf: {mask: {opacity: 0.5, material: clay}} # ~ a number or {texture: name}; a material is a name, or a kind
//!                                                # written in place
//!   worn: {blend: {weight: 0.5, first: clay, second: ring}}          # ~ of the second
//!   card: {two_sided: {front: clay, back: lacquer}}                  # ~ back is the front's; no glass, and beside
//!                                                # a back of its own nothing thin or of hair, which scatters light through
//!   waves: {bump: {height: {texture: earth}, scale: 1, material: clay}}
//!                                                # ~ scale; metres along the normal; of bilinear pictures, as else
//!                                                # there are no slopes
//!   scales: {normal_map: {normals: {texture: earth}, material: clay}}
//!                                                # of a picture with raw: true, else it is decoded as colours are
//!                                                # both: turn: true, shadowing: true
//! media:
//!   smoke:
//!     homogeneous: {absorption: 0.1, scattering: {rgb: [0.2, 0.3, 0.4]}, phase: {hg: 0.5}}
//!                                                # m⁻¹, ~ 0; phase: ~ isotropic, rayleigh, {hg: g}, |g| < 1,
//!                                                #   {table: [1, 2, 4]} over cos θ from -1 to 1,
//!                                                #   {blend: {weight: 0.3, of: [isotropic, {hg: 0.8}]}}
//!   milk: {homogeneous: {extinction: 5, albedo: 0.99, scale: 1, shadow_rays: true}}    # ~ scale, shadow_rays
//!   cloud: {heterogeneous: {extinction: {volume: haze}, albedo: 0.9, scale: 1}}        # and phase, shadow_rays
//! light_groups: {key: [ball]}       # lamps by group, for layers; names as given or made of kind and number (point0);
//!                                   # lamps in none are in the group default, into which others may be put by name
//! assets: {toys: [ball]}            # shapes by what they are part of, for mattes; ~ the group of an instance, or itself
//! medium: smoke                     # what the camera is in, also within a body, but for those with a priority, and all space where
//!                                   # no body is; default none. It has no end: light from infinity comes through only at
//!                                   # wavelengths that it lets pass unhindered
//! fog: {colour: 0.8, start: 5, end: 40}
//!                                   # or {colour, density: 0.1, falloff: exp}: exp (default), exp2
//! groups:                           # shapes that are seen where an instance copies them; none of them shines
//!   tree: [{sphere: {center: [0, 2, 0], radius: 1}}, {cylinder: {base: [0, 0, 0], top: [0, 2, 0], radius: 0.1}}]
//! shapes:
//! - sphere:
//!     center: [0, 1, 0]             # ~ origin
//!     radius: 1
//!                                   # every shape may have, besides its own fields:
//!     name: ball                    # ~ none
//!     material: clay                # a name, or a kind written in place; ~ diffuse 0.5
//!     emission: {blackbody: {kelvin: 5000}}      # spectrum or texture, W·m⁻²·sr⁻¹·nm⁻¹; ~ none
//!     emission_direction: all       # ~ all: the same radiance all over the side of the normal; normal: all light
//!                                   # along the normal, emission in W·m⁻²·nm⁻¹
//!     sampling_weight: 1            # ~ how often light is looked for here, relative to its power; also of lights
//!     inside: smoke                 # media on the two sides; ~ inside a closed shape that light can enter nothing,
//!                                   # else and outside what the camera is in; or vacuum, or both sides unchanged, as
//!                                   # they are of what light cannot enter where neither is written
//!     outside: smoke
//!     transform:                    # applied in this order; ~ none
//!     - translate: [1, 0, 0]
//!     - rotate: {axis: [0, 1, 0], deg: 30}
//!     - scale: 2                    # or [2, 1, 1]
//!     - matrix: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]    # rows
//!     flip_normals: false           # ~ true turns the normal round: emission, inside and outside change sides
//! - plane: {point: [0, 0, 0], normal: [0, 1, 0], tangent: [1, 0, 0]}   # ~ point origin, any tangent
//! - disk: {center: [0, 0, 0], normal: [0, 1, 0], radius: 1}            # ~ center origin
//! - rectangle: {corner: [0, 0, 0], edge_u: [1, 0, 0], edge_v: [0, 0, -1]}   # normal edge_u × edge_v
//! - cube: {center: [0, 0, 0], size: [1, 2, 3]}                         # ~ center origin; or size: 2
//!                                   # sphere and cube: layout: how u and v lie on them, y_up ~ with the top of pictures at +y
//!                                   # and, of a sphere, their middle at +z, or z_up, as in Mitsuba
//! - cylinder: {base: [0, 0, 0], top: [0, 1, 0], radius: 0.5, caps: both}    # ~ both, none, base, top;
//!                                   # seam: [1, 0, 0] is where u = 0, as seen from the axis, ~ chosen
//! - cone: {base: [0, 0, 0], apex: [0, 1, 0], radius: 0.5, cap: true}   # ~ cap
//! - mesh: {file: knot.ply, normals: file}    # .obj, .ply, .serialized; ~ file, smooth, vertex (file, else smooth but
//!                                             # for each vertex of the file by itself), face; and, with defaults,
//!                                             # winding: object (world: by the right hand after the transform, or the
//!                                             # file's normals), flip_v: false, index: 0 (of a .serialized file)
//! - sdf_grid: {file: torus.vol, normals: smooth}                       # ~ smooth, analytic
//! - curves: {file: hair.txt, basis: bspline}                           # ~ linear, bspline
//! - instance: {group: tree}                                            # a copy; besides it only name and transform
//! lights:                           # each may have a name
//! - point: {position: [0, 5, 0], intensity: 10}                        # W·sr⁻¹·nm⁻¹
//! - spot:
//!     position: [0, 5, 0]
//!     target: [0, 0, 0]             # either this or direction: [0, -1, 0]
//!     cutoff_deg: 20                # ~ between axis and edge, up to 90
//!     beam_deg: 15                  # ~ 3/4 cutoff_deg: full intensity within
//!     intensity: {scaled: {by: 2, of: {illuminant: D65}}}
//!     texture: earth                # ~ none; multiplies the intensity, over the square around the edge of the light
//!     up: [0, 0, 1]                 # ~ [0, 1, 0]: of the texture
//!     v: up                         # ~ up, down: which way the texture's v grows
//! - directional: {direction: [0, -1, 0], irradiance: 3, angle_deg: 0}  # W·m⁻²·nm⁻¹; ~ angle_deg: of the disc it comes from
//! - constant: {radiance: 0.1}                                          # W·m⁻²·sr⁻¹·nm⁻¹
//! - environment: {file: sky.exr, scale: 1, rotate_deg: 0, mapping: texels, transform: [{scale: [-1, 1, 1]}]}
//!                                   # ~ all but file; rotate_deg is about y; mapping: columns to the right turn from -z toward
//!                                   # +x, from the middle of the picture (texels) or from its left edge, with the first and the
//!                                   # last row at the poles (mitsuba); transform as of shapes: turns and mirrors
//! - sky:                            # a clear day, in W·m⁻²·sr⁻¹·nm⁻¹: zenith +y, north -z, east +x
//!     sun: {elevation_deg: 40, azimuth_deg: 120}   # ~ azimuth_deg: 0, from north toward east; or
//!                                   # direction: [1, 2, 3], toward it in the world; or latitude_deg, longitude_deg and,
//!                                   # with defaults, utc_offset: longitude_deg / 15, rounded, year: 2000, month: 6, day: 21,
//!                                   # hour: 12: where it stands there; below the horizon all is dark, as the fits have no
//!                                   # twilight
//!     turbidity: 3                  # ~ 1 to 10
//!     albedo: 0.3                   # ~ of the ground
//!     sky_scale: 1                  # ~
//!     sun_scale: 1                  # ~ two lights, one without sun and one without sky, have layers of their own
//!     sun_angle_deg: 0.5358         # ~ a wider disc gives the same light, above the horizon
//!     limb_darkening: false         # ~
//!     transform: []                 # ~ as of an environment
//! - projector:
//!     origin: [0, 2, 0]
//!     target: [0, 2, -1]
//!     up: [0, 1, 0]                 # ~
//!     fov_deg: 40
//!     fov_axis: x                   # ~ as of the camera, along the sides of the image
//!     v: up                         # ~ as of a spot
//!     irradiance: {texture: earth}  # ~ white; over π on a screen at a distance of 1 m, W·m⁻²·nm⁻¹
//!     scale: 1                      # ~
//! ```
//!
//! A sphere, cylinder or cone takes only transforms that keep it one: moves, turns and even
//! scaling. An instance takes any that can be inverted.
//!
//! An `sdf_grid` is the zero of signed distances, positive outside, on a grid that fills the unit cube before its
//! transform; the file is Mitsuba's `.vol`; u and v are 0 all over it, so that pictures and boards show one colour there.
//! `curves` are read from lines of `x y z radius`; an empty line ends a curve.
//! `linear` has round joints and ends and wants two points or more a curve, `bspline` (uniform and cubic, open at the
//! ends) four. A transform moves the points and leaves the radii. Rays meet curves from outside only; v runs along all of
//! the file and u about a curve, from the horizontal with z up, as in Mitsuba: pictures stay where they are as a transform
//! turns a curve about itself; an instance takes them along. Neither form shines.
//!
//! Bodies of `dielectric` may overlap where they have a `priority`, any whole number: the higher one has the place, of
//! equal ones that which is written first. Light then goes by the ratio of the indices of the two that truly meet, and the
//! medium is that which `inside` names for the one that has the place. So liquid reaches into the wall of its glass (glass
//! above liquid), and ice into water, and no surfaces have to touch. Such a body is a closed shape or a plane, which bounds
//! all that is behind it; its `exterior_ior` is not written; up to eight may share a place. The camera and lamps may be
//! inside.
//!
//! A `film` lies on the side of the normal, between what is there and the material; light from its two faces interferes,
//! at each wavelength. Its thickness is a number, or follows a texture of numbers: `{texture: name, from: 100, to: 800}`,
//! nm where they are 0 and 1; ~ 0 and 1, for a texture of nanometres.
//!
//! # Frames
//! In the place of any number, or list of numbers, a map may stand whose keys are frames: the value changes over them.
//! ```yaml
//! # frames
//! - {0: 1.0, 48: 2.5}                                     # straight from key to key; 1.0 before, 2.5 after
//! - {0: 1, 24: 3, 48: 2.5, interpolation: smooth}         # ~ linear; smooth, step
//! - {keys: [[0, 1.0], [48, 2.5]]}                         # the same as a table; and interpolation
//! - {keys: {file: radius.csv}}                            # the same in a file: frame and value, or values, with commas, semicolons or blanks
//! ```
//! So a camera moves (`origin: {0: [0, 1, 5], 100: [2, 1, 5]}`), a lamp fades, a shape turns
//! (`rotate: {axis: [0, 1, 0], deg: {0: 0, 100: 360}}`). Lists run number by number: a matrix between two turned ones is no
//! turn, and what turns is better written as `rotate`. Frames increase, and may have fractions; all values have the same
//! length. `smooth` is a monotone cubic (Steffen 1990): its slope has no jumps, it is still at its first and last key, and it
//! leaves the range of no two keys, so that what is valid at the keys is so between them. Numbers that must be whole have to
//! come out whole; names, files, true and false do not change.
//!
//! With a `shutter` of the camera all that changes while it is open is blurred, cameras, shapes, lights and materials alike:
//! each sample sees the scene at one of a number of evenly spaced moments. `image`, `integrator`, `layers`, `render` and
//! `output` stay as at the frame. Where photons are merged all pixels of a sample see the same moment. `whitted` draws no
//! times and shows the frame itself, which `abbe plan` says.
//!
//! Which frames are rendered says `render.frames`, of the scene or of the batch, or `--frames`; a scene that changes and says
//! nothing of frames is refused. Frame 12 is the very picture of a scene in which the values at 12 are written, with the
//! seed `render.seed` + 12 unless `seed_per_frame: false`.
//!
//! # Spectra
//! ```yaml
//! # spectra
//! - 0.5                             # the same at every wavelength
//! - {rgb: [0.8, 0.1, 0.1]}          # linear Rec. 709
//! - {table: [[400, 0.1], [700, 0.9]]}                     # nm and value; nm increases
//! - {file: paint.csv}               # the same, two columns; a wavelength may stand there twice: a jump
//! - {blackbody: {kelvin: 5000, scale: 1, normalised: true}}            # defaults but kelvin
//! - {illuminant: D65}               # a CIE illuminant
//! - {illuminant: {name: D65, scale: 3}}
//! - {lines: [{nm: 589, power: 1, width_nm: 1}]}           # defaults but nm
//! - {scaled: {by: 2, of: {illuminant: D65}}}
//! - {zero_outside: {table: [[400, 0.1], [700, 0.9]]}}     # or file
//! ```
//! A reflectance lies in 0 to 1; an emission and a coefficient (η, k, absorption, scattering) is 0 or
//! more. Beyond its ends a table or file of emission is 0; a reflectance or coefficient keeps its last value, unless
//! `zero_outside`; so does a square of a checkerboard, be it of light or not. `blackbody`, `illuminant` and `lines` are emissions only. An illuminant, and a black body unless
//! `normalised` is false, is scaled to luminance 1, which is that of the number 1; then comes its `scale`. A black body that is
//! not normalised has its radiance by Planck's law, W·m⁻²·sr⁻¹·nm⁻¹. Where a texture is allowed it is written
//! `{texture: name}`; a picture, a volume or an attribute with numbers above 1 is light and no reflectance.
//!
//! # Refractive indices
//! ```yaml
//! # indices
//! - 1.5                             # without dispersion
//! - {glass: N-SF11}                 # by catalogue name
//! - {sellmeier: {b: [1.03961212, 0.231792344, 1.01046945], c: [0.00600069867, 0.0200179144, 103.560653]}}
//! - {cauchy: [1.5046, 0.0042]}      # µm²; a third number, µm⁴, may follow
//! - {abbe: {nd: 1.5, vd: 30}}
//! - {table: [[350, 1.54], [840, 1.51]]}
//! - {schott: [2.2718929, -0.010108077, 0.010592509, 0.00020816965, -7.6472538e-6, 4.9240991e-7]}
//! - {formula: {number: 2, coefficients: [0, 1.03961212, 0.00600069867]}}      # of refractiveindex.info, 1 to 9
//! - {file: N-BK7.yml}               # YAML of refractiveindex.info, or CSV (wl,n and wl,k in µm) of its site
//! ```
//! An index has to hold over 360 to 830 nm: a table covers that, and a formula has no resonance there; and it is 0.1 to 10, also
//! in the fields that want one without dispersion. A formula of the
//! catalogue or a file is used beyond the range for which it is stated if that covers 405 to 700 nm (strontium titanate's
//! begins at 430), with a note; and so are the last values of a table of k that a file has beside its n. Where a
//! file says how much its material absorbs (k), a closed body of `dielectric` whose `inside` is not written does so, by
//! σ = 4πk/λ. An index below 1 belongs to a metal, which has k: `dielectric` refuses such files, and notes such numbers,
//! which are right as a ratio to another index only.
//! (The Sellmeier coefficients, c in µm², are those that Schott publishes for N-BK7.)
//!
//! # A batch
//! ```yaml
//! # batch
//! output: {dir: out}                # laid over the scenes' own, field by field
//! render: {samples: 256}
//! scenes:
//! - file: scenes/a.yaml             # the output's name is the file's, `a`, if there is no name; it is no pattern
//! - file: scenes/a.yaml
//!   name: a-nofog
//!   set: {fog: null, render.samples: 16, "shapes[2].sphere.radius": 2, materials.flint.dielectric.ior: 1.7}
//! - file: scenes/c.xml            # a Mitsuba scene
//!   define: {res: 64, integrator: path}         # its parameters, as -D on the command line
//! ```
//! A setting names a field by its path and gives it a new value, whole; null takes it away, but for an
//! element of a list. The path may lead to a field that is not written yet, as long as the grammar has it.
//! Later wins: default, scene, batch, `set` of the entry, `--set KEY=VALUE` of the command line.
//!
//! # Mitsuba scenes
//! A file whose name ends in `.xml` is a scene of Mitsuba 3 and is translated into this grammar: `mitsuba`. All that
//! follows, `--set` too, is the same.
//!
//! # Bounds
//! Of fields whose bounds do not stand beside them above; `a` is any name. Roughness, thickness and sampling have theirs in every
//! material. Coordinates and lengths reach 1e60, light and the strength of highlights 3.4e38; a black body has 50 to 1e12 K, a
//! line a width of 0.01 nm or more.
//! ```yaml
//! # bounds
//! camera.shutter.moments: [2, 256]
//! image.filter.tent.radius: [0, 256]                    # and stddev, and that of lanczos; pixels, above 0
//! image.overscan: [0, 16384]
//! integrator.path.light_samples: [0, 65536]             # and scatter_samples
//! integrator.whitted.max_depth: [1, 256]
//! integrator.whitted.grid: [1, 1024]
//! render.samples: [1, 134217728]                        # and of stop
//! render.tile: [1, 65536]
//! render.frames_per_second: [0.001, 1.0e6]
//! output.spectral.bands: [1, 512]
//! output.png.exposure: [-64, 64]
//! output.png.white_balance: [1000, 40000]               # K
//! materials.a.conductor.eta: [0, 1.0e6]                 # and k
//! materials.a.conductor.roughness: [0, 10]
//! materials.a.conductor.film.thickness_nm: [0, 1.0e8]
//! materials.a.principled.sampling.specular: [1.0e-6, 1.0e6]      # of others 0, too
//! materials.a.hair.tilt_deg: [-10, 10]
//! lights[0].sky.sun.elevation_deg: [-90, 90]             # and latitude_deg
//! lights[0].sky.sun.longitude_deg: [-360, 360]
//! lights[0].sky.sun.utc_offset: [-24, 24]
//! lights[0].sky.sun.year: [1900, 2100]
//! lights[0].sky.sun.hour: [-1.0e6, 1.0e6]
//! lights[0].sky.sun_angle_deg: [0.0001, 90]
//! lights[0].directional.angle_deg: [0.0001, 180]         # or 0
//! ```
//!
//! # Faults
//! Each is one line, `file:line:column: field: expected …, found …; did you mean "…"?`. Text that
//! cannot be read, or does not follow the grammar, stops at the first fault; numbers out of range
//! and unknown names are told all at once. Limits: 64 MiB of text (256 in all files of a Mitsuba scene, each as often as it is
//! included), 64 levels, 4 million values with aliases written out.

mod absorption;
mod animation;
mod batch;
mod camera;
mod coating;
mod compound;
mod decode;
mod edit;
mod emitter;
mod exr_file;
mod fault;
mod frames;
mod hair;
mod image;
mod keyed;
mod layer;
mod light;
mod material;
mod medium;
mod mitsuba;
mod nesting;
mod node;
mod optical_data;
mod output;
mod path;
mod path_map;
mod principled;
mod print;
mod scene;
mod settings;
mod shape;
mod sky;
mod spectrum;
mod texture;
mod transform;
mod volume;
mod yaml;

pub use absorption::{Absorption, ColorAt};
pub use animation::{Animation, Motion};
pub use batch::{Batch, BatchEntry, Document, load, load_mapped};
pub use camera::{Camera, Clip, FovAxis, Lens, Pose, Projection, Shutter, ShutterTimes};
pub use coating::{Film, TexturedThickness, Thickness};
pub use compound::{
    Blend, Brushed, Bump, LEAST_ALPHA, Mask, NormalMap, NumberOrTexture, Roughness, TextureRef, TwoSided,
};
pub(crate) use edit::named_bytes;
pub use emitter::{EmissionDirection, EnvironmentLight, EnvironmentMapping, Growth, ProjectorLight};
pub use exr_file::{FileLayout, HeaderValue, HeaderValues, SpectralFile, Standard, counted_rate, standard, time_code};
pub use frames::{Frames, frames, frames_in_short};
pub use hair::{Hair, HairColour};
pub use image::{Band, Crop, Filter, Image, MAX_SIDE};
pub use layer::{Data, Layer, LayerContent, LightForm, LightWay, Matte, Quantity};
pub use light::{Aim, ConstantLight, DirectionalLight, Falloff, Fog, FogLaw, Light, PointLight, SpotLight};
pub use material::{
    Boundary, Conductor, ConductorIndex, Dielectric, Diffuse, DiffuseMean, Distribution, Fresnel, Highlight,
    HighlightModel, Material, MaterialRef, Mirror, Plastic, ThinDielectric,
};
pub use medium::{Coefficients, HeterogeneousMedium, HomogeneousMedium, Medium, Phase, PhaseBlend};
pub(crate) use medium::{UNCHANGED, VACUUM};
pub use mitsuba::export::{Exported, Loss, MeshNormals, Meshes, PictureAnew, PictureRead, export};
pub(crate) use node::did_you_mean;
pub use optical_data::{OpticalData, ReadK, optical_data};
pub use output::{
    Channels, Colour, Compression, Exposure, Exr, Output, Png, PngDither, PngSpace, Precision, Tonemap, WhiteBalance,
};
pub(crate) use path::field;
pub use path_map::PathMap;
pub use principled::{
    Contrast, Luminance, MOST_CROSSING, MOST_STRENGTH, Principled, PrincipledThin, Sampling, ThinSampling,
};
pub use print::yaml;
pub use scene::{DEFAULT_GROUP, Locator, SceneDescription};
pub use settings::{
    Coverage, DepthIntegrator, Effects, Integrator, LightTracerIntegrator, MOST_SAMPLES, NoIntegrator, PathIntegrator,
    Render, SAMPLES_LIMIT, ShadowRays, Stop, Technique, Techniques, Time, Wavelengths, WhittedIntegrator, duration,
    share,
};
pub use shape::{
    Caps, Cone, Cube, CurveBasis, Curves, Cylinder, Disk, Geometry, Instance, Layout, Mesh, Normals, Plane, Rectangle,
    SdfGrid, SdfNormals, Shape, Sphere, Winding,
};
pub use sky::{SkyLight, Sun, SunPlace};
pub use spectrum::{
    Abbe, Blackbody, Cauchy, FilePath, Illuminant, Index, Line, NumberedFormula, Scaled, Sellmeier, Spectrum,
    SpectrumOrTexture, Vec3,
};
pub use texture::{Checkerboard, ImageTexture, MeshAttribute, Texture, TextureFilter, Wrap};
pub use transform::{Extent, Rotation, TransformStep};
pub use volume::{ConstantVolume, GridVolume, NumberOrVolume, SpectrumOrVolume, Volume, VolumeFilter};

#[cfg(test)]
pub(crate) mod testing;

#[cfg(test)]
mod tests;
