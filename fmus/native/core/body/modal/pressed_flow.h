/* The exact flow of a body that rigid and Kelvin-Voigt stops hold or yield to, while no other contact touches.
 *
 * The body is then linear: its complex modes (modes/pressed_modes.h, modes/coupled_modes.h) decay independently, at any
 * rates, around the response to the loads. So a long rest is followed like a flight. The contacts' forces and the
 * clearances of the others are sums of terms, and certified steps may leave out the fast terms. equations.md 3.4, 6.9
 */
#ifndef VIBROIMPACT_PRESSED_FLOW_H
#define VIBROIMPACT_PRESSED_FLOW_H

#include "body/modal/state.h"
#include "modes/coupled_modes.h"
#include "modes/coupled_response.h"
#include "modes/pressed_terms.h"
#include "motion/flow.h"
#include "motion/majorant.h"

/* Observed quantities: displacements of the contacts and of the observed point, and forces of the contacts. */
enum { VI_SEEN_OBSERVED = VI_PORTS, VI_SEEN_FORCE, VI_SEEN = VI_SEEN_FORCE + VI_PORTS };

/* Knowledge of a rest's modes: not searched yet, found for one contact, found for all contacts, or not found. */
typedef enum { VI_MODES_UNKNOWN = 0, VI_MODES_OF_ONE = 1, VI_MODES_OF_ALL = 2, VI_MODES_NOT_FOUND = 3 } vi_modes_known;

/* Cache of the body's modes on its present contacts, no part of the state: its contents follow from the body. */
struct vi_pressed {
    int32_t known;                 /* vi_modes_known */
    int32_t searched;              /* the modes of all contacts have been searched for */
    int32_t contacts;              /* of the body */
    int32_t port[VI_PORTS];        /* contact of the body, for each pressed contact */
    vi_pressed_body body, present; /* present: the body on its present contacts */
    double shape[VI_PORTS][VI_MODES], observed[VI_MODES];
    vi_pressed_modes modes;
    vi_complex weight[VI_SEEN][VI_TERMS]; /* of each term in the observed quantities */
    vi_coupled_equations still, harmonic; /* of the responses */
    vi_coupled_work work;
};

/* Find the contacts on which the body rests, all others being free. Returns their number; 0 where the motion is not
 * linear. It is not on a power law, on a force from another FMU, or on a stop whose point others hold. */
int vi_pressed_contacts(const vi_structure *s, int32_t port[VI_PORTS]);

/* The modes of the body on its present contacts; NULL where they do not give its motion to the last digits. `all`:
 * modes of several contacts, or of coupling or strong damping, are worth their cost. This cost counts for no budget,
 * since the cache is no part of the state. */
const vi_pressed *vi_pressed_find(const vi_structure *s, bool all);

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
