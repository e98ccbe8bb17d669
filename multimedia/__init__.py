"""Photogrammetry through air, glass and water: the refraction model of Maas and its tools.

Z = 0 is the interface on the water side, Z up, cameras at Z > 0, points in water at Z < 0; heights
and depths handed to the formulas are positive distances. Lengths in one unit, any; angles in rad.

The media
    Layers                    plane-parallel media: indices and thicknesses
    water_refractive_index    of water, from wavelength, temperature, salinity and depth
    water_index_derivatives, water_index_sigma, WaterIndexDerivatives   its precision
    salinity_from_index, temperature_from_index      the other way round
    WaterFormula: HOEHLE, QUAN_FRY, PARRISH          the published formulas
    air_refractive_index      of air
    Material: FLOAT_GLASS, N_BK7, FUSED_SILICA, ACRYLIC, POLYCARBONATE, SAPPHIRE   of ports
    critical_angle, refracted_angle, refracted_direction   Snell's law
Radial shift
    radial_shift, radial_shift_derivatives, ShiftDerivatives   where straight rays see a point
    radial_shift_ratio, ShiftTable   relative; from a look-up table
    iterated_radius, best_over_compensation, ShiftIteration   the iteration as published
Surfaces and rays
    FlatInterface, Interfaces what lies between camera and object
    Plane, Sphere, Cylinder, RasterSurface, MeshSurface, WaveSurface   of any shape
    trace_rays, aim_rays, RayPaths, RayStatus   from the camera, or to a point; why there is none
Cameras
    Camera, Sensor            exterior and interior orientation
    Brown, Fisheye            distortion of a lens, or the law of a fisheye
    project, projection_status, image_rays   image coordinates, why there are none; rays in water
    resect, Resection, resect_many, CameraPoses   a camera from control points; many of them
    intersect, IntersectedPoints   points from image points, least squares
    intersect_rays, intersect_pairs, PointStatus   fast ways; why a point is missing, doubtful
    epipolar_curve, EpipolarCurves, epipolar_candidates, Candidates   a ray in another image
    find_targets, TargetImages, correspondences, track_particles, Tracks   particles, over time
    calibrated_on_particles, SelfCalibration   cameras adjusted on the particles that they see
    bundle_adjust, Adjustment, Unknowns, ScaleBar, diagnose, Extension    all of these together
Bathymetry
    correct_bathymetry, CorrectedPoints   points from above the water
    correct_lidar_beams; intersect_refracted_rays, RayIntersections   laser echoes; measured rays
    mean_water_level, WaterLevel; depth_offsets, DepthOffsets   from tie points; against soundings
    wave_effect, WaveEffect, wave_statistics, WaveCase   what waves do to points; frames
    Precision, BathymetryStatus       what goes in, what became of a point
Colours
    shift_per_colour, layers_per_colour, colour_positions, seam_width, correct_dispersion
Planning and simplified models
    study_setup, Study        precision, ray angles, sensitivities
    compare_placements, Placement, ring_of_cameras, object_grid   where to put cameras
    calibration_costs, CalibrationCosts   calibrating in air or in water
    lavest, agrafiotis, telem, Approximation   models without rays, and their error
Files
    read_project, write_project, Project, ImagePoints, ObjectPoints
    read_experiment, write_experiment, Experiment    OpenPTV folders
    convert, Conversion       cameras of COLMAP, Metashape, OpenCV, AquaCal, in and out

What they take and give: Body, Convention, DepthClass, DepthTrend, DetectedTargets, HeightField,
Media, Medium, OpticalMedia, PlaneCandidates, RefractingSurface, Sight, SurfaceSequence, Term,
WaterSurface.

Errors are one family with one message each that says what is wrong, where, and how to mend it:
PhotogrammetryError > InputError (a ValueError) > CellError, WorkbookError, MissingExtraError;
GeometryError (a ValueError); ConvergenceError. Files in, files out: the command `multimedia`.
"""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
