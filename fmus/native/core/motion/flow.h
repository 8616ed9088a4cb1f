/* The exact motion of one mode between impacts: equations.md 1.2 to 1.5, in dimensional form.
 *
 *     x'' + 2 decay x' + stiffness x = force cos(angular_frequency t) + further sines + held + held_rate (t - t0) + ...
 *
 * all per unit mass. Stiffness and decay may be negative: the motion then grows (equations.md 1.9), and its bounds hold
 * up to twice the length of its segment. Two forms of the same solution, chosen once for each segment:
 *  - the steady response is split off, wherever it is not much larger than the motion itself;
 *  - otherwise (near resonance, slow forcing, no spring) a Taylor series, exact to the last bit on a short segment.
 *    A huge steady response would cost the digits by which it exceeds the motion.
 */
#ifndef VIBROIMPACT_FLOW_H
#define VIBROIMPACT_FLOW_H

#include "motion/segment.h"

/* Prepare a mode; mass > 0, angular_frequency >= 0, any stiffness and damping, in SI units. */
void vi_mode_start(vi_mode *mode, double mass, double damping, double stiffness, double amplitude,
                   double angular_frequency);

/* Put another harmonic force on the mode: amplitude per unit mass (m/s^2), angular frequency (rad/s). */
void vi_mode_drive(vi_mode *mode, double force, double angular_frequency);

/* Put `sines` further sines on the mode, or others: amplitudes per unit mass and angular frequencies > 0. */
void vi_mode_drive_further(vi_mode *mode, int sines, const double force[], const double angular_frequency[]);

/* The force of the further sines at their phases, per unit mass. */
double vi_further_force(const vi_mode *mode, const vi_phase further[]);

/* The phases of the further sines `u` seconds later. */
void vi_further_after(const vi_mode *mode, const vi_phase start[], double u, vi_phase end[]);

/* Begin a segment of at most `length` seconds at displacement x, velocity v and forcing phase (rad). The series form
 * may shorten the length. `local` demands the series form, for low bounces: displacements are counted from the start,
 * so a bounce of 1e-12 m on a stop at 1 m keeps all its digits. */
void vi_segment_start(vi_segment *segment, const vi_mode *mode, double x, double v, vi_phase phase, double held,
                      double held_rate, double length, bool local);

/* Begin segments of several modes at one instant, as vi_segment_start does for one mode; or local ones. */
void vi_segments_start(vi_segment segments[], const vi_mode modes[], int count, const double x[], const double v[],
                       const vi_drive *drive, double length);
void vi_segments_start_local(vi_segment segments[], const vi_mode modes[], int count, const double x[],
                             const double v[], const vi_drive *drive, double length);

/* Count the homogeneous part of a split segment from an earlier state of the same motion, which drops the rounding
 * added since. The mode is underdamped. (x, v) and `amplitude` hold `since` + `since_low` seconds before the start. */
void vi_segment_continue(vi_segment *segment, double x, double v, double amplitude, double since, double since_low);

vi_phase vi_phase_of(double angle);

/* Displacement and velocity `u` >= 0 s later, unforced: x = phi[0] x0 + phi[1] v0, v = phi[2] x0 + phi[3] v0. */
void vi_mode_propagator(const vi_mode *mode, double u, double phi[4]);

/* Functions of the time u from which a propagator is built. */
typedef struct {
    double slow, fast;   /* exp(-slow u) and exp(-fast u) if overdamped; else both exp(-decay u) */
    double lost;         /* 1 - exp(-2 rate u), if overdamped */
    double cosine, sine; /* of rate u, if underdamped */
} vi_mode_functions;

/* Propagator as vi_mode_propagator, from functions that the caller has evaluated. */
void vi_mode_propagator_by(const vi_mode *mode, double u, const vi_mode_functions *functions, double phi[4]);

/* The motion `u` seconds after the start of a segment without further sines and of degree 1. */
void vi_segment_at(const vi_segment *segment, double u, vi_motion *motion);

/* The part of a segment after `u` seconds: the homogeneous part of a split segment (no steady response, no level), or
 * all of a series. Bodies of many modes add these parts up. At the start the part is the given state: no evaluation. */
void vi_segment_part(const vi_segment *segment, double u, vi_part *part);

/* Displacement and velocity after `u` seconds at phases that are known exactly. u: within the segment for a series or
 * a load of higher degree, else any time. */
void vi_segment_end(const vi_segment *segment, double u, vi_phase phase, const vi_phase further[], double *x,
                    double *v);

/* Add the response to the further sines and to the load's terms of higher degree, of a split segment. */
void vi_segment_add_further(const vi_segment *segment, double u, const vi_phase further[], double *x, double *v);

#endif
