/* The exact flow of a body while one contact is held at rest, or presses a Kelvin-Voigt stop, and nothing else
 * touches.
 *
 * The body is linear then: its complex modes (modes/pressed_modes.h) decay each on its own, whatever their rates,
 * around the response to the loads. So a long rest is followed as a flight is: the contact's force and the
 * clearances of the others are sums of terms, and certified steps may leave out the fast ones. equations.md 3.4, 6.9 */
#ifndef VIBROIMPACT_PRESSED_FLOW_H
#define VIBROIMPACT_PRESSED_FLOW_H

#include "body/modal/structure_state.h"
#include "modes/pressed_modes.h"
#include "motion/flow.h"
#include "motion/majorant.h"

/* What is seen of the motion: displacements of the contacts and of the observed point, and the force. */
enum { VI_SEEN_OBSERVED = VI_PORTS, VI_SEEN_FORCE, VI_SEEN };

/* Modes of the body as it rests now, kept until it rests otherwise: no part of its state, as they follow from what
 * it is. */
struct vi_pressed {
    int32_t known, usable;
    int32_t contacts;
    vi_pressed_body body;
    double shape[VI_PORTS][VI_MODES], observed[VI_MODES];
    vi_pressed_modes modes;
    vi_complex weight[VI_SEEN][VI_TERMS]; /* of each term in what is seen */
};

/* The modes of the body that rests on contact k; NULL where they do not tell its motion to the last digits. Finding
 * them counts for no budget: whether they are kept is no part of the state. */
const vi_pressed *vi_pressed_find(const vi_structure *s, int k);

typedef struct {
    const vi_pressed *pressed;
    double angle, angular_frequency;         /* forcing phase at the start, rad; rad/s */
    vi_complex part[VI_TERMS];               /* of each term, `since` before the start */
    double since, since_low;                 /* s, and its rounding */
    vi_complex harmonic[VI_MODES], harmonic_force; /* response to the harmonic force */
    double level[VI_MODES], level_rate[VI_MODES];  /* to the constant loads and their slopes */
    double force_level, force_rate;
} vi_pressed_flow;

/* Begin at the present state, for at most `length` seconds; false where the response would take digits off the
 * motion. */
bool vi_pressed_flow_start(vi_pressed_flow *flow, const vi_structure *s, int k, const vi_pressed *pressed,
                           double length);

/* Count the flow, which starts now on contact k, from where the rest was first followed; begin to count here
 * otherwise. */
void vi_pressed_flow_follow(vi_pressed_flow *flow, const vi_structure *s, int k);

/* The flow has brought the body to its present state without an event. */
void vi_pressed_flow_reach(const vi_structure *s);

/* The terms after u. */
void vi_pressed_flow_parts(const vi_pressed_flow *flow, double u, vi_complex part[]);

/* Modal state after u. */
void vi_pressed_flow_end(const vi_pressed_flow *flow, double u, double q[], double p[]);

/* Integral of the force over u seconds, N s. */
double vi_pressed_flow_impulse(const vi_pressed_flow *flow, double u);

/* What is seen, with clearance = offset - sign * what is seen. */
typedef struct {
    const vi_complex *weight;
    double sign, offset;
    double cosine, sine, level, level_rate; /* of the response */
    double scale;                           /* size of the terms added up */
} vi_pressed_sight;

/* `seen`: a contact, VI_SEEN_OBSERVED or VI_SEEN_FORCE. */
vi_pressed_sight vi_pressed_sight_of(const vi_pressed_flow *flow, int seen, double sign, double offset, double length);

vi_approach vi_pressed_approach(const vi_pressed_sight *sight, const vi_pressed_flow *flow, const vi_complex part[],
                                double u);

/* A certified step of it, as vi_point_step. */
double vi_pressed_step(const vi_pressed_sight *sight, const vi_pressed_flow *flow, const vi_complex part[], double u,
                       double horizon);

#endif
