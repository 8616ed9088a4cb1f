/* The maxima between the impacts of a periodic orbit: does it pass through a stop? */
#ifndef VIBROIMPACT_ORBIT_MAXIMUM_H
#define VIBROIMPACT_ORBIT_MAXIMUM_H

#include "door/door.h"
#include "door/orbit_response.h"

/* Largest displacement beyond a stop (m, negative: clearance) among all maxima inside the flights of an orbit, kinks at
 * impacts of other contacts included: what[0], its phase what[1], its contact what[2]; -infinity, 0, -1 without any. All
 * maxima are found: pieces are bounded by the third derivative. */
VI_DOOR int vi_door_orbit_maximum(const vi_orbit_body *body, const vi_orbit_train *train, const double state[],
                                  double what[3]);

#endif
