"""Where Abbe and Mitsuba 3 say the same thing in different words.

Everything that the comparison corrects for stands in this file and in `mitsuba_xml.py`; nothing is
corrected anywhere else. Mitsuba's side was read in its source at tag v3.9.1.

Brightness. Both integrate radiance times the CIE 1931 colour matching functions over 360 to 830 nm.
Abbe divides by the integral of y-bar, so that a spectrum of 1 has Y = 1. Mitsuba divides by
`MI_CIE_Y_NORMALIZATION` (include/mitsuba/core/spectrum.h), which is 0.1 % less, so that it has
Y = 1.000999. Mitsuba's pixels are therefore multiplied by `PIXEL_FACTOR`.

D65 and RGB emission. Both scale D65 such that it has Y = 1 under their own normalisation (Mitsuba:
src/spectra/d65.cpp), so these agree without the factor. As the factor is applied to whole pictures, such
emission (and environment maps, which are RGB) is written for Mitsuba divided by it.

Numbers, tables, black bodies, lines. Raw spectral radiance on both sides, zero outside their range, a
black body in W m^-2 sr^-1 nm^-1: the factor applies and nothing else.

Tables of the observer. Abbe has one row a nanometre, Mitsuba one in five, linear between. For
spectra that are smooth over 5 nm the two agree within 0.03 %; a line of 4 nm would not, by up to 1 %.
The cases of dispersion, whose light is such lines, compare pictures relative to the light seen
directly, in which the observer cancels.

Coloured reflectance (RGB) is upsampled to the same family of spectra by both (Jakob and Hanika 2019);
Mitsuba's table is good to 0.05 % of the colour.

Refractive index outside. Mitsuba's default is air, Abbe's vacuum: written out for Mitsuba.

Materials. Diffuse, conductor and plastic are seen from both sides in Abbe unless they say
`two_sided: false`: wrapped in `twosided` for Mitsuba.

Two places where Mitsuba is not exact are avoided rather than forgiven. `volpathmis` loses energy by its
Russian roulette: a white sphere of fog in a white sky comes out at 0.997 instead of 1, and at 1.000 with
the roulette off, so it is off. `roughplastic` sums the coat's reflectance from inside over 64 cosines
including both ends and divides by 64, not 63: the light that comes back out of the base is 2 % low. It is
given the reflectance that makes up for it (`mitsuba_xml.under_rough_coat`).

Smaller ones lie within the allowance: Mitsuba's smooth `plastic` has that reflectance by a fit (0.05 %),
and its Rec. 709 matrix is rounded otherwise (0.03 % between the channels).

Smooth normals. Where the interpolated normal faces away from the viewer and the facet does not, Mitsuba
goes by the former and Abbe by the latter. This is a matter of silhouettes; the cases have fine meshes.

Texture coordinates. v = 0 is the bottom of a picture in Abbe and the top in Mitsuba; the sphere's pole
is +y in Abbe and +z in Mitsuba. See `mitsuba_xml.py`.

Environment maps. Abbe has texel centres at half-integers both ways and -z in the middle; Mitsuba has
the first row at the pole itself (align-corners) and -z at the edge. The same function of direction is
written to two files, each on the grid of its reader.
"""

# Integral of y-bar over 360-830 nm, from the table of 1 nm.
Y_INTEGRAL_ABBE = 106.856914916767
# MI_CIE_Y_NORMALIZATION as the float that it is.
Y_INTEGRAL_MITSUBA = 106.7502593994140625

PIXEL_FACTOR = Y_INTEGRAL_MITSUBA / Y_INTEGRAL_ABBE

# Relative difference of a mean that counts as agreement whatever the noise. It covers the observer's
# tables, the upsampling of colours and single precision in Mitsuba, each below 0.1 %.
ALLOWANCE = 0.003

# Luminance of linear Rec. 709.
LUMINANCE = (0.212671, 0.715160, 0.072169)


def n_sf11(nm: float) -> float:
    """Index of SCHOTT N-SF11 by the Sellmeier coefficients of its data sheet, nm in air.

    SCHOTT's indices are relative to air at 20 degrees C; both renderers are given the same number.
    """
    x = (nm * 1e-3) ** 2
    b = (1.73759695, 0.313747346, 1.89878101)
    c = (0.013188707, 0.0623068142, 155.23629)
    return (1 + sum(bi * x / (x - ci) for bi, ci in zip(b, c))) ** 0.5
