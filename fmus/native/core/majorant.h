/* Certified steps: how far a motion may be followed without any chance of having passed its stop.
 *
 * The clearance after s is at least d - v s - a s^2/2 - bound s^3/6, with clearance d >= 0, approach velocity v,
 * approach acceleration a and a bound on the third derivative; no root of the motion lies before the first root of
 * this majorant. One order more than equations.md 2.1: it converges with order three at a transversal contact, needs
 * no step back at a graze, and leaves an impact (d = 0, v < 0) or a touch (d = v = 0, a < 0) by itself.
 */
#ifndef VIBROIMPACT_MAJORANT_H
#define VIBROIMPACT_MAJORANT_H

/* A step s, 0 <= s <= horizon, such that the clearance stays >= 0 over [0, s]. s = horizon: nothing before it. */
double vi_certified_step(double clearance, double velocity, double acceleration, double bound, double horizon);

/* First root of clearance - velocity s - acceleration s^2/2 for s > 0; HUGE_VAL when there is none. */
double vi_parabola_root(double clearance, double velocity, double acceleration);

#endif
