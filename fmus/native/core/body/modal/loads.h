/* Loads on a structure that are signals of time; equations.md 8.9 and 8.10.
 *
 * The polynomials of all signals about the present instant, times their modal forces, are added to the inputs. They are
 * found again whenever the instant changes.
 */
#ifndef VIBROIMPACT_LOADS_H
#define VIBROIMPACT_LOADS_H

#include <stdint.h>

#include "body/modal/state.h"
#include "signals/signal.h"

#if VI_SIGNALS > 0

/* Changes of a mode's displacement and velocity over an interval of a random signal. */
typedef struct {
    double stiffness, decay, interval;    /* that they are made for */
    double of_state[2][2];                /* from displacement and velocity, without their going on: Phi - I */
    double of_held[2];                    /* from a constant load 1 */
    double of_spline[VI_SPLINE_ORDER][2]; /* from each coefficient of the spline */
} vi_interval_response;

/* The signals of a body. They are made from its parameters when they are first needed, and are no part of a state. */
struct vi_signal_loads {
    uint64_t key;  /* of the parameters that they are made for; 0: none */
    int32_t count;
    vi_signal signal[VI_SIGNALS];
    const double *amplitude;         /* [count], of the component */
    const double (*force)[VI_MODES]; /* [count]: modal forces for the amplitude 1, of the component */
    double bend[VI_TABLE_ROOM];      /* of cubic tables */
    vi_interval_response response[VI_MODES];
    vi_random random[VI_SIGNALS];
    vi_transform transform;
};

/* Find the loads at the present instant, after it or the inputs have changed. */
void vi_structure_load(const vi_structure *s);

#else

struct vi_signal_loads {
    uint64_t key;
};

static inline void vi_structure_load(const vi_structure *s)
{
    (void)s;
}

#endif

#endif
