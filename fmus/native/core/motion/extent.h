/* Bounds of the unforced part of a mode's motion. */
#ifndef VIBROIMPACT_EXTENT_H
#define VIBROIMPACT_EXTENT_H

#include "motion/segment.h"

typedef struct {
    double reach, rate, fourth; /* of the displacement, and of its first and fourth derivatives */
} vi_extent;

/* Bounds for the whole segment, where the motion grows up to twice its length. Of a motion in split form. */
vi_extent vi_extent_of(const vi_segment *segment);

#endif
