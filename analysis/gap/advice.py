"""Which capture tells an effect from what looks like it: what each effect depends on and others do not."""

CAPTURES = {
    "camera_pose": "the same scene from a second pose of the camera",
    "object_pose": "the same object seen from a second camera",
    "light_position": "the lamp alone, with an object that casts a shadow in view",
    "light_intensity": "each lamp alone, at the same exposure",
    "light_beam": "the same lamp from another pose of the camera, a flat plate in view",
    "ambient_light": "one capture with all lamps off",
    "albedo": "the same material under a second lamp and with a reference tile in view",
    "interreflection": "the part alone on a black ground",
    "lens_distortion": "a chessboard that fills the image",
    "principal_point": "the same scene with the camera turned by 180 degrees about its axis",
    "vignetting": "a flat field (an integrating sphere or an evenly lit plate), or the camera turned by 90 degrees",
    "defocus": "edges at a second distance",
    "lateral_chromatic_aberration": "black and white edges in the image's corners",
    "veiling_glare": "the same scene at a quarter of the exposure, and a capture with the lens covered",
    "motion_blur": "the same scene with a tenth of the exposure time and ten times the light",
    "black_level": "a capture with the lens covered",
    "exposure": "the same scene at half and at twice the exposure",
    "response_curve": "the same scene at a quarter and at four times the exposure",
    "white_balance": "a grey card under each lamp alone",
    "color_crosstalk": "saturated red, green and blue patches in one image",
    "sensor_noise": "eight repeats or more of one scene",
}


def separating(effect: str, rival: str) -> str:
    """The one more capture that tells ``effect`` from ``rival``."""
    return (
        CAPTURES.get(effect)
        or CAPTURES.get(rival)
        or "the same scene from a second pose and under a second lamp"
    )
