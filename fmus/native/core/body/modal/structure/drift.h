/* The motion of a structure while stops hold it or yield to it: one Taylor segment at a time, up to its first event. */
#ifndef VIBROIMPACT_STRUCTURE_DRIFT_H
#define VIBROIMPACT_STRUCTURE_DRIFT_H

#include "body/modal/structure/events.h"

/* Follow the coupled motion to its next event, the end of a segment or `length`, whichever is first; returns the time
 * moved. *k is the contact of the event, or -1. The state (q, p) is moved, the instant is not. Arrivals up to `room`
 * after the length count as arrivals at the length. */
double vi_structure_drift(const vi_structure *s, double length, double room, vi_drift_event *event, int *k);

#endif
