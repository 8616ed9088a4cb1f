/* The Beam component: modes of an Euler-Bernoulli beam, with stops. */
#ifndef VIBROIMPACT_BEAM_H
#define VIBROIMPACT_BEAM_H

#include <stdint.h>

#include "body.h"
#include "modes/beam_residual.h"
#include "motion/amplitude.h"

enum { BEAM_SENSORS = 4 }; /* most sensors besides the observed point */

/* Numbers of the enumerations BeamForcing and ImpactProjection. */
enum { FORCED_AT_POINT = 1, FORCED_EVENLY = 2, FORCED_AS_MODE = 3, FORCED_BY_BASE = 4 };
enum { PROJECTION_VARIATIONAL = 1, PROJECTION_COLLOCATION = 2 };

typedef struct {
    double location;
    double displacement, velocity, acceleration;
    double shape[VI_MODES]; /* kg^(-1/2) */
} beam_sensor;

/* All variables and state of a Beam, described in variables.toml; copying the struct copies the Beam. */
typedef struct {
    double time;
    /* parameters */
    int64_t modes, modes_described;
    int32_t residual;                    /* the last modes are residual vectors */
    int64_t boundary;
    double length, width, thickness, youngs_modulus, density;
    double flexural_rigidity, mass_per_length, poisson_ratio;
    double damping_ratio[VI_MODES], rayleigh_mass, rayleigh_stiffness;
    vi_amplitude_law amplitude[VI_MODES];
    double modal_displacement_start[VI_MODES], modal_velocity_start[VI_MODES];
    int64_t forcing_kind, forcing_mode;
    double forcing_amplitude, forcing_location, sensor_location;
    int64_t impact_projection;
    double contact_location[VI_PORTS];
    /* inputs */
    double force, force_rate;
    /* derived at initialization */
    vi_beam_residual dropped;            /* residual vectors; its `points` are 0 without them */
    double root_mass;                    /* sqrt(mass of the beam), kg^(1/2) */
    double forced_shape[VI_MODES];       /* of forcing_location, kg^(-1/2) */
    double participation[VI_MODES];      /* modal force of a unit acceleration of the base, kg^(1/2) */
    int32_t depends_on_amplitude;        /* does a mode depend on its amplitude? */
    /* outputs */
    double modal_displacement[VI_MODES], modal_velocity[VI_MODES], modal_acceleration[VI_MODES];
    beam_sensor sensor[BEAM_SENSORS];
    vi_body body; /* last member: its record is saved as far as it is used, and nothing after it */
} beam;

#endif
