/* Stops that move. The motion of a stop is given, so no force changes it: it is that of a body of infinite mass.
 *
 * Each given motion is a mode behind those of the bodies. It is undamped for a sine, and has no spring for a velocity and
 * a table. Row k of the shapes has minus the motion of stop k, so shape_k . q is the displacement of the
 * contact relative to its stop. Impulses and forces of contacts push the modes of the bodies only. Clearances, bounds,
 * sums of chatter, rest and release then need no case for a moving stop. equations.md 6.13
 */
#ifndef VIBROIMPACT_STOP_MOTION_H
#define VIBROIMPACT_STOP_MOTION_H

#include <stdbool.h>

#include "body/modal/state.h"

/* The given motion of a stop at one instant, from the stop's position. */
typedef struct {
    double displacement, velocity, acceleration, jerk; /* m, m/s, m/s^2, m/s^3 */
} vi_stop_course;

/* Number of modes that the motions of these stops need. */
int vi_stop_motions_count(const vi_stop_motion motion[], int contacts);

/* Put the motions of the stops behind the modes of the bodies, after modes and shapes are set. */
void vi_stop_motions_begin(vi_structure_model *model, const vi_stop_motion motion[]);

/* Count the sines by the clock, after it has started or changed its frequency. */
void vi_stop_motions_count_by(vi_structure_model *model);

/* Set displacements, velocities and accelerations of the given motions at `now`. */
void vi_stop_motions_at(const vi_structure *s, vi_instant now);

/* Time for which the accelerations of the given motions have no kink, s. */
double vi_stop_motions_room(const vi_structure *s);

/* A changed motion from now on: it goes on from its phase and its place where a frequency or a velocity changes. */
vi_stop_motion vi_stop_motion_continued(const vi_structure *s, const vi_stop_motion *was, vi_stop_motion motion);

/* Displacement of a stop by its motion now, m. */
double vi_stop_motion_displacement(const vi_structure *s, const vi_stop_motion *motion);

/* Angle of the sine of a motion now, rad. */
double vi_stop_motion_angle(const vi_structure *s, const vi_stop_motion *motion);

/* The motion of the stop of contact k at the present instant. */
vi_stop_course vi_stop_course_of(const vi_structure *s, int k);

/* Work of moving stops on the bodies by these impulses of the contacts, N s, at their present velocities, J. */
double vi_stop_motions_work(const vi_structure *s, const double impulse[]);

#endif
