/* The first contact of a free flight. */
#ifndef VIBROIMPACT_STRUCTURE_SEARCH_H
#define VIBROIMPACT_STRUCTURE_SEARCH_H

#include "body/modal/modal_flight.h"
#include "body/modal/state.h"

typedef enum {
    VI_SEARCH_NOTHING, /* no contact up to u: the end of the flight, or of a search that became too long */
    VI_SEARCH_CONTACT, /* `contact` at u */
    VI_SEARCH_BEYOND   /* the motion goes beyond the largest numbers */
} vi_search_end;

typedef struct {
    int contact;
    double u;              /* s after the start of the flight */
    vi_flight_instant now; /* the last evaluated instant */
    double moment;         /* s from that instant to the contact; NaN where this is too far for vi_flight_end_near */
} vi_search_found;

/* Set up the contact points for a search. */
void vi_search_points(const vi_structure *s, const vi_flight *flight, vi_point points[]);

/* Can no stop ever be reached again under the present input? The envelopes of the motion prove it. */
bool vi_search_is_idle(const vi_structure *s, const vi_flight *flight, const vi_point points[]);

vi_search_end vi_search_flight(const vi_structure *s, const vi_flight *flight, const vi_point points[],
                               vi_search_found *found);

#endif
