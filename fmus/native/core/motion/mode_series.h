/* The Taylor series of a mode's motion, exact to the last bit on a short segment. Several modes go side by side, as each
 * number of a series waits for the one before. equations.md 1.5
 */
#ifndef VIBROIMPACT_MODE_SERIES_H
#define VIBROIMPACT_MODE_SERIES_H

#include "motion/segment.h"

/* Begin the series of a prepared segment at displacement x and velocity v, or those of `count` segments with the same
 * bits. It may shorten the segments. */
void vi_series_begin(vi_segment *segment, double x, double v);
void vi_series_begin_all(vi_segment segments[], int count, const double x[], const double v[]);

/* The motion `u` seconds after the start, and its part; see flow.h. */
void vi_series_at(const vi_segment *segment, double u, vi_motion *motion);
void vi_series_part(const vi_segment *segment, double u, vi_part *part);

/* Displacement and velocity after `u` seconds, with the bits of the series of a part. */
void vi_series_end(const vi_segment *segment, double u, double *displacement, double *velocity);

/* The parts of the first segments after `u` > 0 seconds, side by side while they are series, with the bits of
 * vi_segment_part. Returns their number. */
int vi_series_parts(const vi_segment segments[], int count, double u, vi_part parts[]);

#endif
