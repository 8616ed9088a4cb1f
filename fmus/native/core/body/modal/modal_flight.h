/* The free flight of a structure: each mode on its own exact flow, and points of the body as sums of the modes. */
#ifndef VIBROIMPACT_MODAL_FLIGHT_H
#define VIBROIMPACT_MODAL_FLIGHT_H

#include <stdbool.h>

#include "body/modal/state.h"
#include "motion/flow.h"
#include "motion/majorant.h"
#include "motion/origin.h"

typedef struct {
    const vi_structure_model *model;
    vi_drive drive;           /* what acts on the modes from the start on */
    int sines;                /* number of further sines */
    double angular_frequency; /* rad/s */
    double length;            /* valid for 0 <= u <= length, s; split segments of degree 1 are valid for any u */
    bool series;              /* is any mode followed by series? */
    vi_segment segment[VI_MODES];
} vi_flight;

/* All modes at one instant of a flight. */
typedef struct {
    double u;            /* s after the start */
    double cosine, sine; /* of the clock's phase */
    vi_phase further[VI_SINES_ROOM]; /* of the further sines */
    vi_part part[VI_MODES]; /* the unforced parts */
} vi_flight_instant;

/* Response of a point to a further sine: cosine cos(phase) + sine sin(phase). */
typedef struct {
    double cosine, sine, amplitude, angular_frequency;
    double fourth; /* power of its angular frequency */
} vi_point_sine;

/* A point of the body in a flight, seen from its stop: clearance = offset - sign * displacement. */
typedef struct {
    const double *shape;
    double sign;
    double offset;
    double cosine, sine, level, level_rate; /* particular displacement: the response to the forces */
    double steady;                          /* amplitude of the response to the clock's force, m */
    vi_point_sine further[VI_SINES_ROOM];
    double higher[VI_HIGHER_ROOM]; /* coefficients 2 to degree of the particular displacement */
    double higher_snap;            /* largest fourth derivative of these terms within twice the flight, m/s^4 */
    double scale;                           /* sum of the sizes of the terms; rounding is 1e-16 of this, m */
} vi_point;

/* Begin a flight of at most `length` seconds from modal state (q, p). `local`: by series that count from here, which
 * keeps the digits of low bounces. The series form may shorten the length. */
void vi_flight_start(vi_flight *flight, const vi_structure_model *model, const double q[], const double p[],
                     const vi_drive *drive, double length, bool local);

/* Degree of the flight's loads; a constant where a component has none above 1. */
static inline int vi_flight_degree(const vi_flight *flight)
{
    return VI_DEGREE > 1 ? flight->drive.degree : 1;
}

/* Count the flight, which starts now in (q, p), from the origins of its modes; see origin.h. */
void vi_flight_follow(vi_flight *flight, vi_instant now, const double q[], const double p[], const vi_origin origin[]);

/* Tell the origins that the flight, begun at `start`, has reached (q, p) without an event. */
void vi_flight_reach(const vi_flight *flight, vi_instant start, const double q[], const double p[], vi_origin origin[]);

/* Set up a point whose clearance at the start is known (exactly 0 on a stop). */
void vi_point_start(vi_point *point, const vi_flight *flight, const double shape[], double sign, double clearance);

/* All modes after u seconds. */
void vi_flight_at(const vi_flight *flight, double u, vi_flight_instant *instant);

/* Clearance, approach and bound of a point at an instant. */
vi_approach vi_point_approach(const vi_point *point, const vi_flight *flight, const vi_flight_instant *instant);

/* A certified step of that point, as vi_certified_step. High modes ripple with small displacements but large
 * accelerations; they are left out as vi_rippling_step does. */
double vi_point_step(const vi_point *point, const vi_flight *flight, const vi_flight_instant *instant, double horizon);

/* Largest displacement * sign for all later time; false when no bound exists (series form, sloping input, growth). */
bool vi_point_reach(const vi_point *point, const vi_flight *flight, double *largest);

/* Modal displacements and velocities after u seconds at a known forcing phase, which keeps long flights exact. */
void vi_flight_end(const vi_flight *flight, double u, double angle, const vi_phase further[], double q[], double p[]);

/* The phases of the further sines after u seconds. */
void vi_flight_further(const vi_flight *flight, double u, vi_phase further[VI_SINES_ROOM]);

/* The same state and the forcing phase, `moment` seconds after (or before) an evaluated instant: no evaluation. The
 * moment's fourth power must be negligible. */
void vi_flight_end_near(const vi_flight *flight, const vi_flight_instant *instant, double moment, double q[],
                        double p[], vi_phase *phase);

#endif
