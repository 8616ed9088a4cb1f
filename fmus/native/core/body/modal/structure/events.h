/* Ends of a segment of the coupled motion: the first contact that arrives, is released, separates or returns. */
#ifndef VIBROIMPACT_STRUCTURE_EVENTS_H
#define VIBROIMPACT_STRUCTURE_EVENTS_H

#include <stdbool.h>

#include "body/modal/coupled_flow.h"
#include "body/modal/state.h"

typedef enum {
    VI_DRIFT_NO_EVENT,
    VI_DRIFT_ARRIVAL,
    VI_DRIFT_RELEASE,        /* the force of a held contact has fallen to 0 */
    VI_DRIFT_GENTLE_RELEASE, /* so has the rate of this force */
    VI_DRIFT_LIFT,           /* a sudden load pulls a held contact off */
    VI_DRIFT_SEPARATION,
    VI_DRIFT_RETURN, /* to the compliant surface that it has left */
    VI_DRIFT_FREE    /* a receding contact is out, or its surface has relaxed */
} vi_drift_event;

/* State of the contacts at the start of a segment. */
typedef struct {
    double at[VI_PORTS], sign[VI_PORTS]; /* penetrations, directions */
    double held[VI_MODES];
    vi_press press[VI_PORTS];
    int thin[VI_PORTS]; /* a power law with so little penetration that its force acts as an impulse */
    int kept[VI_PORTS]; /* yielding, but its point is held: it stays as it is */
    bool any_thin, any_acceleration;
    double acceleration[VI_MODES]; /* with all forces; only where a power law may be thin */
    double length;                 /* longest segment that thin contacts and relaxing surfaces allow, s */
} vi_situation;

typedef struct {
    double time;
    vi_drift_event event;
    int contact;
    double searched; /* time up to which all other events are excluded, s */
} vi_event_found;

/* Does contact k stay where it is over the segment, within the rounding of its terms? It does where others hold its
 * point too, for example on the opposite side. */
bool vi_structure_stays(const vi_structure *s, const vi_drift *drift, int k, const double clearance[], double length);

/* The first event within `length`; arrivals are searched up to `searched`. */
vi_event_found vi_structure_first_event(const vi_structure *s, const vi_drift *drift, const vi_situation *now,
                                        double length, double searched);

#endif
