/* Complex modes of a body whose damping couples its modes, as orbits take them: equations.md 4.7. All these modes have
 * springs. */
#ifndef VIBROIMPACT_ORBIT_COUPLING_H
#define VIBROIMPACT_ORBIT_COUPLING_H

#include <stddef.h>

#include "door/door.h"
#include "modes/coupled_modes.h"
#include "modes/pressed_terms.h"

enum { VI_ORBIT_HARMONICS = 48 }; /* most sines of different frequencies, of the force and of the stops */

typedef struct {
    vi_pressed_body body;        /* without contacts; its coupling[][] is the damping */
    vi_pressed_modes terms;      /* terms of its free motion; none next to critical damping, where they would cancel */
    double fastest;              /* bound of all rates, 1/s */
    /* response to each sine of the force: displacement Re(steady e^(i order phase)) */
    vi_complex steady[VI_ORBIT_HARMONICS][VI_MODES];
} vi_orbit_coupling;

/* Size of vi_orbit_coupling, and of the workspace that finds it, in bytes. */
VI_DOOR size_t vi_door_orbit_coupling_size(void);
VI_DOOR size_t vi_door_orbit_coupling_work_size(void);

/* Find the complex modes and the steady responses. coupling[modes][modes]: the damping of mass-normalised modes, 1/s,
 * symmetric but for rounding. Each sine of the force has angular_frequency[harmonics], rad/s, and cosine and
 * sine[harmonics][modes]. Returns 0, or 1 for numbers outside their range. */
VI_DOOR int vi_door_orbit_couple(int modes, int harmonics, const double angular_frequency[], const double natural[],
                                 const double coupling[], const double cosine[], const double sine[],
                                 vi_orbit_coupling *found, vi_coupled_work *work);

/* Free motion for `u` seconds by power series over short steps: it needs no terms. */
void vi_orbit_series(const vi_orbit_coupling *coupling, double u, double x[], double v[]);

/* Find displacements and velocities just after a unit impulse that recurs after each `length` seconds, by the series;
 * impulse[contacts][stride]. False where an undamped motion grows without bound, or any grows beyond the digits. */
bool vi_orbit_recurring_states(const vi_orbit_coupling *coupling, int contacts, const double impulse[], int stride,
                               double length, double state[][VI_STATES]);

/* e^(rate u) of each term. */
void vi_orbit_turns(const vi_orbit_coupling *coupling, double u, vi_complex turn[]);

/* Split a unit impulse that recurs after each `length` seconds, modal velocities `impulse`, into its terms. The part of
 * a term is its share of one impulse over 1 - e^(rate length). False where an undamped term grows without bound. */
bool vi_orbit_recurring_parts(const vi_orbit_coupling *coupling, const double impulse[], double length,
                              vi_complex part[]);

/* Add the motion of all parts, each times its turn, to displacements and velocities that are overwritten. */
void vi_orbit_turned_sum(const vi_orbit_coupling *coupling, const vi_complex part[], const vi_complex turn[],
                         double x[], double v[]);

#endif
