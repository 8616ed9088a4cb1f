/* The exact flow of a body while stops hold it or yield to it, rigid and Kelvin-Voigt ones, and nothing else touches.
 *
 * The body is linear then: its complex modes (modes/pressed_modes.h, modes/coupled_modes.h) decay each on its own, whatever
 * their rates, around the response to the loads. So a long rest is followed as a flight is: the contacts' forces and the
 * clearances of the others are sums of terms, and certified steps may leave out the fast ones. equations.md 3.4, 6.9 */
#ifndef VIBROIMPACT_PRESSED_FLOW_H
#define VIBROIMPACT_PRESSED_FLOW_H

#include "body/modal/state.h"
#include "modes/coupled_modes.h"
#include "modes/coupled_response.h"
#include "modes/pressed_terms.h"
#include "motion/flow.h"
#include "motion/majorant.h"

/* What is seen of the motion: displacements of the contacts and of the observed point, and the forces of the contacts. */
enum { VI_SEEN_OBSERVED = VI_PORTS, VI_SEEN_FORCE, VI_SEEN = VI_SEEN_FORCE + VI_PORTS };

/* How well the modes of a rest are known: not, by those of one contact alone, by those of all; in vain. */
typedef enum { VI_MODES_UNKNOWN = 0, VI_MODES_OF_ONE = 1, VI_MODES_OF_ALL = 2, VI_MODES_NOT_TOLD = 3 } vi_modes_known;

/* Modes of the body as it rests now, kept until it rests otherwise: no part of its state, as they follow from what
 * it is. */
struct vi_pressed {
    int32_t known;                 /* vi_modes_known */
    int32_t sought;                /* those of all have been looked for */
    int32_t contacts;              /* of the body */
    int32_t port[VI_PORTS];        /* contact of the body, of each that it rests on */
    vi_pressed_body body, asked;   /* asked: what it rests on now */
    double shape[VI_PORTS][VI_MODES], observed[VI_MODES];
    vi_pressed_modes modes;
    vi_complex weight[VI_SEEN][VI_TERMS]; /* of each term in what is seen */
    vi_coupled_equations still, harmonic; /* of the responses */
    vi_coupled_work work;
};

/* The contacts that the body rests on, all others being free; their number, 0 where the motion is not linear: on a power
 * law, on a force from another FMU, on a stop whose point others hold. */
int vi_pressed_contacts(const vi_structure *s, int32_t port[VI_PORTS]);

/* The modes of the body on the contacts that it rests on; NULL where they do not tell its motion to the last digits.
 * `all`: the modes of several contacts, or of damping that couples them or is strong, are worth their cost. Finding them
 * counts for no budget: whether they are kept is no part of the state. */
const vi_pressed *vi_pressed_find(const vi_structure *s, bool all);

typedef struct {
    const vi_pressed *pressed;
    double angle, angular_frequency;         /* forcing phase at the start, rad; rad/s */
    vi_complex part[VI_TERMS];               /* of each term, `since` before the start */
    double since, since_low;                 /* s, and its rounding */
    vi_complex harmonic[VI_MODES], harmonic_force[VI_PORTS]; /* response to the harmonic force */
    double level[VI_MODES], level_rate[VI_MODES];            /* to the constant loads and their slopes */
    double force_level[VI_PORTS], force_rate[VI_PORTS];      /* of the contacts that it rests on, in their order */
} vi_pressed_flow;

/* Begin at the present state, for at most `length` seconds; false where the response would take digits off the
 * motion. */
bool vi_pressed_flow_start(vi_pressed_flow *flow, const vi_structure *s, const vi_pressed *pressed, double length);

/* Is the flow, which starts now, the rest that was followed before? Nothing but the exact flow has moved the body then. */
bool vi_pressed_goes_on(const vi_structure *s);

/* Count the flow, which starts now, from where the rest was first followed; begin to count here otherwise. */
void vi_pressed_flow_follow(vi_pressed_flow *flow, const vi_structure *s);

/* The flow has brought the body to its present state without an event. */
void vi_pressed_flow_reach(const vi_structure *s);

/* The terms after u. */
void vi_pressed_flow_parts(const vi_pressed_flow *flow, double u, vi_complex part[]);

/* Modal state after u. */
void vi_pressed_flow_end(const vi_pressed_flow *flow, double u, double q[], double p[]);

/* Integral over u seconds of what grows at `rate` from `start` to `end`, and of a product of two such. */
vi_complex vi_term_integral(vi_complex rate, vi_complex start, vi_complex end, double u);
vi_complex vi_product_integral(vi_complex rate, vi_complex start, vi_complex end, vi_complex other_rate,
                               vi_complex other_start, vi_complex other_end, double u);

/* Integral of the force of the i-th contact that it rests on over u seconds, N s. */
double vi_pressed_flow_impulse(const vi_pressed_flow *flow, int i, double u);

/* What is seen, with clearance = offset - sign * what is seen. */
typedef struct {
    const vi_complex *weight;
    double sign, offset;
    double cosine, sine, level, level_rate; /* of the response */
    double scale;                           /* size of the terms added up */
} vi_pressed_sight;

/* `seen`: a contact, VI_SEEN_OBSERVED or VI_SEEN_FORCE + i, of the i-th contact that it rests on. */
vi_pressed_sight vi_pressed_sight_of(const vi_pressed_flow *flow, int seen, double sign, double offset, double length);

vi_approach vi_pressed_approach(const vi_pressed_sight *sight, const vi_pressed_flow *flow, const vi_complex part[],
                                double u);

/* A certified step of it, as vi_point_step. */
double vi_pressed_step(const vi_pressed_sight *sight, const vi_pressed_flow *flow, const vi_complex part[], double u,
                       double horizon);

#endif
