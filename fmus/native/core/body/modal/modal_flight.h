/* The free flight of a structure: each mode on its own exact flow, and the points of the body as sums of them. */
#ifndef VIBROIMPACT_MODAL_FLIGHT_H
#define VIBROIMPACT_MODAL_FLIGHT_H

#include <stdbool.h>

#include "body/modal/state.h"
#include "motion/flow.h"
#include "motion/majorant.h"
#include "motion/origin.h"

typedef struct {
    const vi_structure_model *model;
    vi_phase phase;           /* of the force at the start */
    double angular_frequency; /* rad/s */
    double length;            /* valid for 0 <= u <= length, s; by split segments for any u */
    bool series;              /* is any mode followed by series? */
    vi_segment segment[VI_MODES];
} vi_flight;

/* All modes at one instant of a flight. */
typedef struct {
    double u;            /* s after the start */
    double cosine, sine; /* of the forcing phase */
    vi_part part[VI_MODES]; /* the unforced parts */
} vi_flight_instant;

/* A point of the body in a flight, seen from a stop: clearance = offset - sign * displacement. */
typedef struct {
    const double *shape;
    double sign;
    double offset;
    double cosine, sine, level, level_rate; /* particular displacement: the part that the forces hold at their pace */
    double steady;                          /* its harmonic amplitude, m */
    double scale;                           /* size of the terms added up: rounding is 1e-16 of this, m */
} vi_point;

/* Begin a flight of at most `length` seconds from modal state (q, p). `local`: counted from here, by series (low
 * bounces keep their digits so). The series form may shorten the length. */
void vi_flight_start(vi_flight *flight, const vi_structure_model *model, const double q[], const double p[],
                     vi_phase phase, const double held[], const double held_rate[], double length, bool local);

/* Count the flight, which starts now in (q, p), from where its modes were first followed; see origin.h. */
void vi_flight_follow(vi_flight *flight, vi_instant now, const double q[], const double p[], const vi_origin origin[]);

/* The flight, begun at `start`, has reached (q, p) without an event. */
void vi_flight_reach(const vi_flight *flight, vi_instant start, const double q[], const double p[], vi_origin origin[]);

/* A point whose clearance at the start is known (exactly 0 on a stop). */
void vi_point_start(vi_point *point, const vi_flight *flight, const double shape[], double sign, double clearance);

/* All modes after u. */
void vi_flight_at(const vi_flight *flight, double u, vi_flight_instant *instant);

/* Clearance, approach and bound of a point at an instant. */
vi_approach vi_point_approach(const vi_point *point, const vi_flight *flight, const vi_flight_instant *instant);

/* A certified step of that point, as vi_certified_step. High modes ripple with small displacements but large
 * accelerations: where the clearance is larger than their ripple they are let out and the ripple is taken off the
 * clearance. Any number of them may be; the longest step wins. */
double vi_point_step(const vi_point *point, const vi_flight *flight, const vi_flight_instant *instant, double horizon);

/* Largest displacement * sign from now on for ever; false when the flight has none (series form, sloping input). */
bool vi_point_reach(const vi_point *point, const vi_flight *flight, double *largest);

/* Modal displacements and velocities after u, the forcing phase there being known (exactly, for long flights). */
void vi_flight_end(const vi_flight *flight, double u, double angle, double q[], double p[]);

/* The same a moment, so short that its fourth power is nothing, after (or before) an instant, and the forcing phase: no
 * evaluation. */
void vi_flight_end_near(const vi_flight *flight, const vi_flight_instant *instant, double moment, double q[],
                        double p[], vi_phase *phase);

#endif
