/* The maxima between the impacts of a periodic orbit, which show whether the orbit passes through a stop. */
#ifndef VIBROIMPACT_ORBIT_MAXIMUM_H
#define VIBROIMPACT_ORBIT_MAXIMUM_H

#include "door/door.h"
#include "door/orbit_response.h"

/* Largest displacement beyond a stop (m, negative: clearance) among all maxima within the flights of an orbit. what:
 * this displacement, its phase and its contact; -infinity, 0, -1 without a maximum. Kinks at impacts of other contacts
 * count. No maximum is missed: the third derivative bounds each piece. */
VI_DOOR int vi_door_orbit_maximum(const vi_orbit_body *body, const vi_orbit_train *train, const double state[],
                                  double what[3]);

#endif
