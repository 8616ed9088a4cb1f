/* The exact flow of a body that rigid and Kelvin-Voigt stops hold or yield to, while no other contact touches.
 *
 * The body is then linear: its complex modes (modes/pressed_modes.h, modes/coupled_modes.h) decay independently, at any
 * rates, around the response to the loads. So a long rest is followed like a flight. The contacts' forces and the
 * clearances of the others are sums of terms, and certified steps may leave out the fast terms. equations.md 3.4, 6.9
 */
#ifndef VIBROIMPACT_PRESSED_FLOW_H
#define VIBROIMPACT_PRESSED_FLOW_H

#include "body/modal/pressed_cache.h"
#include "motion/flow.h"
#include "motion/majorant.h"

typedef struct {
    const vi_pressed *pressed;
    double angle, angular_frequency;         /* forcing phase at the start, rad; rad/s */
    vi_complex part[VI_TERMS];               /* of each term, at `since` before the start */
    double since, since_low;                 /* s, and its rounding */
    vi_complex harmonic[VI_MODES], harmonic_force[VI_PORTS]; /* response to the harmonic force */
    double level[VI_MODES], level_rate[VI_MODES];            /* response to the constant loads and their slopes */
    double force_level[VI_PORTS], force_rate[VI_PORTS];      /* of the pressed contacts, in their order */
} vi_pressed_flow;

/* Begin at the present state, for `length` seconds at most; false where the response costs the motion digits. */
bool vi_pressed_flow_start(vi_pressed_flow *flow, const vi_structure *s, const vi_pressed *pressed, double length);

/* Does the flow, which starts now, continue the rest followed before? Then only the exact flow has moved the body. */
bool vi_pressed_goes_on(const vi_structure *s);

/* Count the flow, which starts now, from the origin of the rest; make a new origin if the rest is new. */
void vi_pressed_flow_follow(vi_pressed_flow *flow, const vi_structure *s);

/* Tell the origin that the flow has brought the body to its present state without an event. */
void vi_pressed_flow_reach(const vi_structure *s);

/* The terms after u seconds. */
void vi_pressed_flow_parts(const vi_pressed_flow *flow, double u, vi_complex part[]);

/* Modal state after u seconds. */
void vi_pressed_flow_end(const vi_pressed_flow *flow, double u, double q[], double p[]);

/* Integrals over u seconds of a quantity that grows at `rate` from `start` to `end`, and of a product of two such. */
vi_complex vi_term_integral(vi_complex rate, vi_complex start, vi_complex end, double u);
vi_complex vi_product_integral(vi_complex rate, vi_complex start, vi_complex end, vi_complex other_rate,
                               vi_complex other_start, vi_complex other_end, double u);

/* Integral of the force of the i-th pressed contact over u seconds, N s. */
double vi_pressed_flow_impulse(const vi_pressed_flow *flow, int i, double u);

/* An observed quantity, with clearance = offset - sign * quantity. */
typedef struct {
    const vi_complex *weight;
    double sign, offset;
    double cosine, sine, level, level_rate; /* of the response */
    double scale;                           /* sum of the sizes of the terms */
} vi_pressed_sight;

/* `seen`: a contact, VI_SEEN_OBSERVED, or VI_SEEN_FORCE + i for the force of the i-th pressed contact. */
vi_pressed_sight vi_pressed_sight_of(const vi_pressed_flow *flow, int seen, double sign, double offset, double length);

vi_approach vi_pressed_approach(const vi_pressed_sight *sight, const vi_pressed_flow *flow, const vi_complex part[],
                                double u);

/* A certified step of an observed quantity, as vi_point_step. */
double vi_pressed_step(const vi_pressed_sight *sight, const vi_pressed_flow *flow, const vi_complex part[], double u,
                       double horizon);

#endif
