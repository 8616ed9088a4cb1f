/* Orbits of a body without a force: their period is unknown (equations.md 4.16). The clock of the body has the period of
 * the orbit, and no sine turns with it.
 *
 * Velocities do not follow from the phases then: the equations of the velocities are homogeneous. So phases and
 * velocities are unknown, and both the distances and the speeds have errors.
 */
#ifndef VIBROIMPACT_ORBIT_PERIOD_H
#define VIBROIMPACT_ORBIT_PERIOD_H

#include "door/door.h"
#include "door/orbit_response.h"

/* Find the errors of phases and velocities; error[2 impacts] is 0 for an orbit. First come the distances beyond the stops
 * at the impacts, m. Then come the speeds before the impacts less those of the motion, m/s. slope[2 impacts][2 impacts + 1]: derivatives over
 * the phases, the velocities, and the logarithm of the period at these phases. Returns one of VI_ORBIT_*. */
VI_DOOR int vi_door_orbit_errors(const vi_orbit_body *body, const vi_orbit_train *train, const double velocity[],
                                 double error[], double slope[]);

#endif
