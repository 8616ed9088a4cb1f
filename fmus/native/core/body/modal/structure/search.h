/* The first contact of a free flight. */
#ifndef VIBROIMPACT_STRUCTURE_SEARCH_H
#define VIBROIMPACT_STRUCTURE_SEARCH_H

#include "body/modal/modal_flight.h"
#include "body/modal/state.h"

typedef enum {
    VI_SEARCH_NOTHING, /* no contact up to u: the end of the flight, or of a long search */
    VI_SEARCH_CONTACT, /* `contact` at u */
    VI_SEARCH_BEYOND   /* the motion goes beyond the largest numbers */
} vi_search_end;

typedef struct {
    int contact;
    double u;              /* s after the start of the flight */
    vi_flight_instant now; /* the last instant that was evaluated */
    double moment;         /* s from it to the contact; NaN where that is too far for vi_flight_end_near */
} vi_search_found;

/* The points that the stops see. */
void vi_search_points(const vi_structure *s, const vi_flight *flight, vi_point points[]);

/* Can no stop ever be reached again under the present input? Their envelopes prove it. */
bool vi_search_is_idle(const vi_structure *s, const vi_flight *flight, const vi_point points[]);

vi_search_end vi_search_flight(const vi_structure *s, const vi_flight *flight, const vi_point points[],
                               vi_search_found *found);

#endif
