#include "measuring/cell.h"

#include <math.h>
#include <string.h>

static const double PI = 3.14159265358979323846;
/* Length of a stretch, in radians of its fastest rate, below which it is followed by its series. A jump of the force
 * over 1e-12 s would otherwise lose all digits beside its slope. */
static const double SHORT_STRETCH = 0.7;
/* Ringing, N, below which the cell counts as at rest: processors are slow with numbers near the smallest. */
static const double NO_RING = 1e-200;

void vi_cell_start(vi_cell *cell, double time, double force)
{
    const double natural = 2.0 * PI * cell->settings.natural_frequency;
    vi_mode_start(&cell->mode, 1.0, 2.0 * cell->settings.damping_ratio * natural, natural * natural, 0.0, 0.0);
    cell->turn = cell->settings.contact_duration > 0.0 ? PI / cell->settings.contact_duration : 0.0;
    cell->time = time;
    cell->force = cell->seen = force;
    cell->seen_rate = cell->sine = cell->cosine = 0.0;
    cell->first = cell->count = 0;
}

double vi_cell_load(const vi_cell *cell)
{
    return cell->force + cell->cosine;
}

double vi_cell_volts(const vi_cell *cell)
{
    const vi_cell_settings *given = &cell->settings;
    const double seen = given->natural_frequency > 0.0 ? cell->seen : vi_cell_load(cell);
    return given->sensitivity * seen + given->offset + given->drift * cell->time;
}

size_t vi_cell_unused(const vi_cell *cell)
{
    return sizeof(vi_pulse) * (size_t)(VI_CELL_PULSES - cell->first - cell->count);
}

bool vi_cell_hit(vi_cell *cell, double impulse)
{
    if (cell->first + cell->count == VI_CELL_PULSES) {
        if (cell->first == 0) {
            return false;
        }
        memmove(cell->pulses, cell->pulses + cell->first, (size_t)cell->count * sizeof(vi_pulse));
        cell->first = 0;
    }
    const double peak = 0.5 * cell->turn * impulse;
    cell->pulses[cell->first + cell->count] = (vi_pulse){cell->time + cell->settings.contact_duration, peak};
    cell->count += 1;
    cell->sine += peak;
    return true;
}

/* End the half sine that began first: its second sine begins. */
static void end_pulse(vi_cell *cell)
{
    cell->sine += cell->pulses[cell->first].peak;
    cell->first += 1;
    cell->count -= 1;
    if (cell->count == 0) {
        cell->first = 0;
        cell->sine = cell->cosine = 0.0; /* cancelled sines leave rounding */
    }
}

/* Move the cell under half sines alone, or free; its state counts from the level of the straight force. */
static void ring(const vi_cell *cell, double span, double *x, double *v)
{
    vi_mode mode = cell->mode;
    const double peak = sqrt(cell->sine * cell->sine + cell->cosine * cell->cosine);
    double angle = 0.0;
    if (peak > 0.0) {
        vi_mode_start(&mode, 1.0, 2.0 * mode.decay, mode.stiffness, mode.stiffness * peak, cell->turn);
        angle = atan2(-cell->sine, cell->cosine);
    }
    while (span > 0.0) { /* once, except near resonance: there in parts of .7 rad, at most half a turn */
        vi_segment segment;
        vi_motion motion;
        vi_segment_start(&segment, &mode, *x, *v, vi_phase_of(angle), 0.0, 0.0, span, false);
        vi_segment_at(&segment, segment.length, &motion);
        *x = segment.origin + motion.x;
        *v = motion.v;
        angle += cell->turn * segment.length;
        span -= segment.length;
    }
}

/* Move the cell by one series for the force and the half sines together. */
static void ring_shortly(const vi_cell *cell, double span, double slope, double *x, double *v)
{
    vi_mode mode = cell->mode;
    const double square = mode.stiffness, peak = sqrt(cell->sine * cell->sine + cell->cosine * cell->cosine);
    const double angle = peak > 0.0 ? atan2(-cell->sine, cell->cosine) : 0.0;
    mode.force = square * peak;
    mode.angular_frequency = cell->turn;
    vi_segment segment;
    vi_motion motion;
    vi_segment_start(&segment, &mode, *x, *v, vi_phase_of(angle), square * cell->force, square * slope, span, true);
    vi_segment_at(&segment, span, &motion);
    *x = segment.origin + motion.x;
    *v = motion.v;
}

static void follow(vi_cell *cell, double span, double slope)
{
    const vi_mode *mode = &cell->mode;
    if (span * fmax(mode->fastest, cell->count > 0 ? cell->turn : 0.0) <= SHORT_STRETCH) {
        ring_shortly(cell, span, slope, &cell->seen, &cell->seen_rate);
        return;
    }
    const double level = cell->force - 2.0 * mode->decay * (slope / mode->stiffness);
    double x = cell->seen - level, v = cell->seen_rate - slope;
    ring(cell, span, &x, &v);
    if (fabs(x) + fabs(v) / mode->natural < NO_RING) {
        x = v = 0.0;
    }
    cell->seen = level + slope * span + x;
    cell->seen_rate = slope + v;
}

/* Pass to `time`; no half sine ends before. */
static void pass(vi_cell *cell, double time, double slope)
{
    const double span = time - cell->time;
    if (!(span > 0.0)) {
        return;
    }
    if (cell->mode.natural > 0.0) {
        follow(cell, span, slope);
    }
    if (cell->count > 0) {
        const double angle = cell->turn * span, c = cos(angle), s = sin(angle), cosine = cell->cosine;
        cell->cosine = c * cosine + s * cell->sine;
        cell->sine = c * cell->sine - s * cosine;
    }
    cell->force += slope * span;
    cell->time = time;
}

void vi_cell_advance(vi_cell *cell, double time, double slope)
{
    while (cell->count > 0 && cell->pulses[cell->first].end <= time) {
        pass(cell, cell->pulses[cell->first].end, slope);
        end_pulse(cell);
    }
    pass(cell, time, slope);
}
