/* What a stop answers. The same functions serve the bodies (fused) and the ImpactStop FMU (coupled): a stop only
 * evaluates its law, the body alone resolves the contact. */
#ifndef VIBROIMPACT_CONTACT_LAW_H
#define VIBROIMPACT_CONTACT_LAW_H

#include <stdbool.h>
#include <stdint.h>

/* The numbers are those of the enumeration ContactLaw. */
enum {
    VI_LAW_NONE = 0,
    VI_LAW_RESTITUTION = 1,
    VI_LAW_KELVIN_VOIGT = 2,
    VI_LAW_HERTZ = 3,
    VI_LAW_HUNT_CROSSLEY = 4,
    VI_LAW_EXTERNAL = 5,      /* another FMU answers with a coefficient of restitution */
    VI_LAW_EXTERNAL_FORCE = 6, /* another FMU answers with a force and its slopes */
    VI_LAW_PAIR = 7            /* no stop: the importer says what another body gives this point */
};
enum { VI_SIDE_UPPER = 1, VI_SIDE_LOWER = 2 };

/* Parameters of a law at one stop. */
typedef struct {
    int64_t law;
    double restitution;    /* 0 to 1, below the yield velocity */
    double yield_velocity; /* above it restitution falls as (V / yield_velocity)^(-1/4), m/s; 0: it is constant */
    double stiffness;      /* N/m; N/m^1.5 for hertz, N/m^exponent for hunt_crossley */
    double damping;        /* kelvin_voigt: N s/m; hunt_crossley: chi of F = K d^n (1 + chi d'), s/m */
    double exponent;       /* hunt_crossley */
} vi_contact_law;

/* The force of a compliant stop and its slopes, at one penetration and rate of penetration. */
typedef struct {
    double force;     /* N, >= 0: a stop does not pull */
    double stiffness; /* its slope over penetration, N/m */
    double damping;   /* its slope over the rate, N s/m */
} vi_contact_force;

/* Coefficient of restitution for a speed of approach (m/s, >= 0). */
double vi_contact_law_restitution(const vi_contact_law *law, double approach_velocity);

/* Force of a compliant law; all zero without penetration (m, > 0) or where it would pull. equations.md 6.9, 6.10 */
vi_contact_force vi_contact_law_force(const vi_contact_law *law, double penetration, double rate);

/* Is this a law that a stop can evaluate by itself? */
bool vi_contact_law_known(int64_t law);

/* Is there a stop that the body looks for by itself? */
static inline bool vi_contact_law_has_stop(int64_t law)
{
    return law != VI_LAW_NONE && law != VI_LAW_PAIR;
}

/* Does the stop yield (a force law), instead of answering with an impulse? */
static inline bool vi_contact_law_is_compliant(int64_t law)
{
    return law == VI_LAW_KELVIN_VOIGT || law == VI_LAW_HERTZ || law == VI_LAW_HUNT_CROSSLEY;
}

/* +1 for a stop above the motion, -1 for one below: displacements times this approach the stop as they grow. */
static inline double vi_contact_direction(int64_t side)
{
    return side == VI_SIDE_LOWER ? -1.0 : 1.0;
}

#endif
