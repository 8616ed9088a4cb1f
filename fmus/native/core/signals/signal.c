#include "signals/signal.h"

#include <stddef.h>

static const double PI = 3.141592653589793116;

/* ---- preparation ---- */

/* A half sine is a chirp without a change of frequency, that begins a quarter of a turn before its crest. */
static vi_chirp half_sine(double duration)
{
    const double w = PI / duration;
    return vi_chirp_of(false, -0.5 * PI, w, w, duration);
}

/* Instants and heights of a triangle or a trapezoid, a rectangle without a rise. */
static void find_pulse(vi_signal *s)
{
    const double rise = s->kind == VI_TRIANGLE ? 0.5 * s->duration : s->rise;
    const double knot[] = {0.0, rise, s->duration - rise, s->duration}, height[] = {0.0, 1.0, 1.0, 0.0};
    int count = 0;
    for (int k = 0; k < VI_PULSE_POINTS; ++k) {
        const double before = count > 0 ? s->knot[count - 1] : -1.0;
        count -= knot[k] == before && height[k] == 1.0 ? 1 : 0;
        if (knot[k] > before || height[k] == 1.0) {
            s->knot[count] = knot[k];
            s->height[count] = height[k];
            count += 1;
        }
    }
    s->table = (vi_table){.count = count};
}

vi_density vi_signal_density(const vi_signal *s)
{
    vi_density density = {s->angular_frequency, s->end_angular_frequency, s->table};
    if (density.low == 0.0 && density.high == 0.0 && s->table.count > 0) {
        density.low = s->table.time[0];
        density.high = s->table.time[s->table.count - 1];
    }
    return density;
}

void vi_signal_prepare(vi_signal *s)
{
    if (s->kind == VI_CHIRP_LINEAR || s->kind == VI_CHIRP_LOGARITHMIC) {
        s->chirp = vi_chirp_of(s->kind == VI_CHIRP_LOGARITHMIC, s->phase, s->angular_frequency,
                               s->end_angular_frequency, s->duration);
    } else if (s->kind == VI_HALF_SINE) {
        s->chirp = half_sine(s->duration);
    } else if (s->kind == VI_TRIANGLE || s->kind == VI_TRAPEZOID) {
        find_pulse(s);
    } else if (s->kind == VI_RANDOM) {
        const vi_density density = vi_signal_density(s);
        vi_random_shape(s->random, s->transform, &density);
    }
}

/* ---- pieces ---- */

/* A piece of a chirp, a half sine or a random signal, between start and end. */
static void find_inside(vi_signal *s, vi_twofold since, double left, double resolution, vi_piece *piece)
{
    if (s->kind == VI_RANDOM) {
        vi_random_piece(s->random, s->transform, s->seed, since, resolution, piece);
        piece->length = fmin(piece->length, left);
    } else {
        vi_chirp_piece(&s->chirp, since, left, piece);
    }
}

void vi_signal_piece(vi_signal *s, vi_twofold time, vi_piece *piece)
{
    if (s->kind == VI_NO_SIGNAL) {
        vi_piece_zero(piece, HUGE_VAL);
        return;
    }
    const double resolution = vi_piece_resolution(time);
    vi_twofold since = vi_twofold_difference(time, (vi_twofold){s->start, 0.0});
    if (s->kind == VI_TABLE_LINEAR || s->kind == VI_TABLE_CUBIC) {
        vi_table_piece(&s->table, since, resolution, piece);
        return;
    }
    if (s->kind == VI_TRIANGLE || s->kind == VI_TRAPEZOID) {
        const vi_table pulse = {s->table.count, s->knot, s->height, NULL};
        vi_table_piece(&pulse, since, resolution, piece);
        return;
    }
    const double left = s->duration > 0.0 ? (s->duration - since.high) - since.low : HUGE_VAL;
    if (since.high + resolution < 0.0) {
        vi_piece_zero(piece, -since.high);
    } else if (left <= resolution) {
        vi_piece_zero(piece, HUGE_VAL);
    } else {
        since = since.high < 0.0 ? (vi_twofold){0.0, 0.0} : since;
        find_inside(s, since, left, resolution, piece);
    }
}
