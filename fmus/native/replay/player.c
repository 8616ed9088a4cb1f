#include "player.h"

#include <math.h>
#include <stddef.h>

/* Distance from a sample, as a part of the sampling interval, below which a time is at the sample. The slope is then
 * that of the segment beginning there. Summed steps of an importer may fall a little short of the sample. */
static const double SAME_INSTANT = 1e-4;
/* Distance added to this, in spacings of doubles at the time, for records far from time 0. */
static const double ROUNDINGS = 4.0;

static double instant(const vi_axis *axis, int64_t index)
{
    return axis->times == NULL ? axis->start + (double)index * axis->interval : axis->times[index];
}

/* Time between two samples, s. */
static double span(const vi_axis *axis, int64_t left, int64_t right)
{
    return axis->times == NULL ? (double)(right - left) * axis->interval : axis->times[right] - axis->times[left];
}

/* The last sample not after `time`, or the first sample. */
static int64_t index_before(const vi_axis *axis, double time)
{
    int64_t low = 0, high = axis->count; /* the sample is in [low, high) */
    if (axis->times == NULL) {
        const double place = (time - axis->start) / axis->interval;
        return !(place >= 0.0) ? 0 : place >= (double)(high - 1) ? high - 1 : (int64_t)place;
    }
    while (high - low > 1) {
        const int64_t middle = low + (high - low) / 2;
        if (axis->times[middle] <= time) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

vi_place vi_axis_place(const vi_axis *axis, double time)
{
    const int64_t last = axis->count - 1;
    vi_place place = {.index = index_before(axis, time)};
    const int64_t segment = place.index < last ? place.index : last - 1;
    const double spacing = nextafter(fabs(time), INFINITY) - fabs(time);
    const double room = SAME_INSTANT * span(axis, segment, segment + 1) + ROUNDINGS * spacing;
    if (place.index < last && instant(axis, place.index + 1) - time <= room) {
        place.index += 1;
    }
    place.since = time - instant(axis, place.index);
    place.on_sample = fabs(place.since) <= room;
    place.outside = !place.on_sample && (place.since < 0.0 || place.index == last);
    return place;
}

/* Nearest samples with a value: up to `index` (-1: none), and after it (the count: none). */
typedef struct {
    int64_t left, right;
} vi_neighbours;

static vi_neighbours neighbours(const vi_signal *signal, int64_t index)
{
    /* gaps before `low` begin up to index + 1, gaps from `high` on begin later; a value lies between any two */
    int64_t low = 0, high = signal->gap_count;
    while (low < high) {
        const int64_t middle = low + (high - low) / 2;
        if (signal->gaps[middle].first <= index + 1) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    vi_neighbours found = {index, index + 1};
    if (low > 0 && signal->gaps[low - 1].last >= index) { /* otherwise the gap ends before the index */
        const vi_gap gap = signal->gaps[low - 1];
        found.left = gap.first <= index ? gap.first - 1 : index;
        found.right = gap.last + 1;
    }
    return found;
}

/* Slope between two samples with a value; 0 before the first sample and after the last. */
static double slope(const vi_signal *signal, const vi_axis *axis, vi_neighbours between)
{
    if (between.left < 0 || between.right >= axis->count) {
        return 0.0;
    }
    return (signal->values[between.right] - signal->values[between.left]) / span(axis, between.left, between.right);
}

/* Play a sample with a value. The remainder of a step that falls short of the sample belongs to the segment before. */
static vi_playing at_sample(const vi_signal *signal, const vi_axis *axis, const vi_place *place, vi_neighbours around)
{
    const double rate = slope(signal, axis, around);
    double before = rate;
    if (place->since < 0.0) {
        before = place->index > 0 ? slope(signal, axis, neighbours(signal, place->index - 1)) : 0.0;
    }
    return (vi_playing){signal->values[place->index] + before * place->since, rate, true};
}

vi_playing vi_signal_at(const vi_signal *signal, const vi_axis *axis, const vi_place *place)
{
    const vi_neighbours around = neighbours(signal, place->index);
    if (around.left == place->index && place->on_sample) {
        return at_sample(signal, axis, place, around);
    }
    if (place->outside || around.left < 0 || around.right >= axis->count) {
        return (vi_playing){signal->values[around.left >= 0 ? around.left : around.right], 0.0, false};
    }
    const double rate = slope(signal, axis, around);
    const double since = span(axis, around.left, place->index) + place->since;
    const bool measured = around.left == place->index && around.right == place->index + 1;
    return (vi_playing){signal->values[around.left] + rate * since, rate, measured};
}
