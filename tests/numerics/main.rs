//! Hard numbers: scenes and functions where a renderer loses digits, each with its answer derived.
//!
//! Scenes are written in Mitsuba's XML, as they come from elsewhere, and rendered by the library ([`xml`]); every sample
//! has to be valid. Rays without a picture are counted by `sweep`: `cargo bench --bench sweep`.
//!
//! | case | what | held by |
//! |---|---|---|
//! | O01 | unit sphere from 1e6 | `a_unit_sphere_is_met_from_a_million_radii` |
//! | O02 | 1 ± 1e-12 from tangency | `hit_and_miss_are_exact_a_trillionth_from_tangency` |
//! | O03 | horizon of the Earth | `the_horizon_is_where_it_should_be` |
//! | O04 | along a cylinder's wall | `a_ray_along_the_axis_enters_by_one_cap_and_leaves_by_the_other` |
//! | O05 | parallel to a generator | `a_ray_parallel_to_a_generator_is_solved` |
//! | O06 | mirror nappe | `the_mirror_nappe_is_not_there` |
//! | O07 | apex | `rays_at_the_apex_hit_below_it` |
//! | O08 | parallel to a flat shape | `a_parallel_ray_misses_and_gives_no_nan` |
//! | O09 | along a cube's face | `a_ray_along_a_face_plane_is_consistent` |
//! | O10 | slivers, no area | `degenerate_triangles_give_no_nan`, `slivers_and_triangles_without_area_leave_no_holes` |
//! | O11 | torus | there is no torus |
//! | O12 | pbrt's bad triangle | `collinear_vertices_are_missed` |
//! | O13 | along a slanted cylinder | `a_view_along_a_slanted_axis_is_a_disc_of_the_cap` |
//! | O14 | pbrt's Reintersect | `no_shape_is_met_again_and_no_exit_is_missed`, `sweep`; copies: `copies_under_extreme_transforms_are_bodies_like_others` |
//! | O15 | lamp in a thin shell of glass | `a_lamp_in_a_skin_of_glass_shows_what_the_skin_lets_through` |
//! | O16 | Embree's tessellated sphere | `embrees_tessellated_sphere_is_watertight` |
//! | O17 | grazing sun on triangles | `a_flat_plane_of_triangles_is_lit_evenly_by_a_grazing_sun` |
//! | O18 | dark room in bright light | `no_light_leaks_into_a_closed_room` |
//! | O19 | chords at grazing | `chords_of_spheres_are_two_r_cosine` |
//! | O20 | pbrt's spheres | `light_in_pbrts_spheres_is_one` |
//! | O21 | Fresnel at grazing, near 1 | `dielectric_keeps_its_digits_at_grazing_and_near_index_one`, `sweep` |
//! | O22 | total reflection | `total_reflection_is_classified_exactly`, `sweep` |
//! | O23 | conductor with k = 0 | `a_conductor_without_absorption_is_a_dielectric`, `surfaces_at_the_ends_of_their_parameters_stay_within_bounds` |
//! | O24 | GGX at α = 1e-4, cos 1e-4 | `density_of_a_nearly_smooth_surface_keeps_its_digits`, `visible_normals_have_the_stated_density_at_grazing` |
//! | O25 | g = ±0.999999 | `henyey_and_greenstein_integrates_to_one`, `narrow_peaks_keep_their_digits` |
//! | O26 | small, near, surrounding sphere light | `the_density_of_a_sphere_light_is_right_from_afar_and_finite_up_close`, `a_body_inside_a_lamp_gets_light_from_all_sides` |
//! | O27 | small triangle light | `lamps_of_tiny_triangles_light_by_their_solid_angle` |
//! | O28 | BK7; poles | `bk7_has_its_index_at_three_lines`, `an_index_with_a_pole_in_the_band_is_refused_with_its_place` |
//! | O29 | ends of the band | `wavelengths_of_the_first_and_last_u_stay_in_the_band`, `wavelengths_stay_in_the_band_and_have_weights` |
//! | O30 | RGB to spectrum and back | `colours_come_back_from_their_spectra` |
//! | O31 | thin, thick, empty media | `white_media_are_invisible_and_black_ones_follow_beer`, `thick_media_reflect_by_chandrasekhars_h` |
//! | O32 | fog | `fog_is_its_closed_form_in_the_picture`, `fog_is_the_closed_form_at_every_depth` |
//! | O33 | a sphere's u, v | `sphere_texture_coordinates_are_clean_at_seam_and_poles` |
//! | O34 | bilinear look-ups | `bilinear_look_ups_are_the_closed_form_at_centres_edges_and_beyond` |
//! | O35 | random numbers below 1 | `random_numbers_are_below_one` |
//! | O36 | filters on a constant scene | `filters_keep_a_constant_scene_constant` |
//! | O37 | a million samples | `a_film_of_a_million_samples_is_the_mean` |
//! | O38 | what is no number | `invalid_samples_are_counted_and_end_with_code_4`, `samples_that_cannot_be_added_are_counted_by_cause` |
//! | O39 | sizes 2^k | `scenes_of_every_kind_have_the_same_bits_at_sizes_of_powers_of_two` |
//! | O40 | bad input | `what_is_no_length_matrix_or_key_is_refused_with_its_place`, tests/cli/faults.rs |

#[path = "../common/mod.rs"]
mod common;

mod bsdfs;
mod forms;
mod lamps;
mod matter;
mod meshes;
mod rooms;
mod scale;
mod spheres;
mod surfaces;
mod values;
mod xml;
