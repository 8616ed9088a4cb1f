#include "body/modal/loads.h"

#include <math.h>
#include <string.h>

#include "motion/majorant.h"

#if VI_SIGNALS > 0

_Static_assert(VI_DEGREE >= VI_PIECE_DEGREE, "loads have room for the degree of a piece");

/* Row n of the loads' coefficients. */
static double *coefficients(vi_structure_state *state, int n)
{
    return n == 0 ? state->held : n == 1 ? state->held_rate : state->higher[n - 2];
}

/* Add a piece of a signal; rows above the degree so far are zeroed first. */
static void add(const vi_structure *s, const vi_piece *piece, double amplitude, const double force[])
{
    vi_structure_state *state = s->state;
    const size_t width = (size_t)vi_structure_modes(s->model) * sizeof force[0];
    for (; state->degree < piece->degree; ++state->degree) {
        memset(coefficients(state, (int)state->degree + 1), 0, width);
    }
    for (int n = 0; n <= piece->degree; ++n) {
        double *const row = coefficients(state, n);
        const double factor = amplitude * piece->coefficient[n];
        for (int j = 0; j < vi_structure_modes(s->model); ++j) {
            row[j] += factor * force[j];
        }
    }
    state->loads_last = vi_min(state->loads_last, piece->length);
}

void vi_structure_load(const vi_structure *s)
{
    vi_structure_state *state = s->state;
    vi_signal_loads *loads = s->loads;
    if (loads == NULL) {
        return;
    }
    vi_twofold time;
    time.high = vi_clock_time_twofold(&s->model->clock, state->now, &time.low);
    const double elapsed = vi_clock_elapsed(&s->model->clock, state->input_since, state->now);
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        state->held[j] = state->input[j] + state->input_rate[j] * elapsed;
        state->held_rate[j] = state->input_rate[j];
    }
    state->held_since = state->now;
    state->degree = 1;
    state->loads_last = HUGE_VAL;
    for (int k = 0; k < loads->count; ++k) {
        vi_piece piece;
        vi_signal_piece(&loads->signal[k], time, &piece);
        state->signal_value[k] = piece.coefficient[0];
        add(s, &piece, loads->amplitude[k], loads->force[k]);
    }
}

#endif
