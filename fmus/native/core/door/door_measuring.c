#include "door/door_measuring.h"

#include <math.h>

#include "door/door.h"
#include "measuring/converter.h"
#include "measuring/gaussian.h"
#include "measuring/magnet.h"
#include "measuring/reading.h"

VI_DOOR size_t vi_door_cell_size(void)
{
    return sizeof(vi_cell);
}

VI_DOOR void vi_door_cell_start(vi_cell *cell, const vi_cell_settings *settings, double time, double force)
{
    cell->settings = *settings;
    vi_cell_start(cell, time, force);
}

VI_DOOR int vi_door_cell_follow(vi_cell *cell, size_t count, const double times[], const double forces[], size_t hits,
                                const double hit_times[], const double impulses[], double volts[])
{
    size_t hit = 0;
    for (size_t k = 0; k < count; ++k) {
        const double span = times[k] - cell->time, slope = span > 0.0 ? (forces[k] - cell->force) / span : 0.0;
        for (; hit < hits && (hit_times[hit] <= times[k] || k + 1 == count); ++hit) {
            vi_cell_advance(cell, fmin(fmax(hit_times[hit], cell->time), times[k]), slope);
            if (!vi_cell_hit(cell, impulses[hit])) {
                return 1;
            }
        }
        vi_cell_advance(cell, times[k], slope);
        cell->force = forces[k];
        volts[k] = vi_cell_volts(cell);
    }
    return 0;
}

VI_DOOR void vi_door_gaussian(uint64_t seed, uint64_t channel, uint64_t first, size_t count, double numbers[])
{
    for (size_t k = 0; k < count; ++k) {
        numbers[k] = vi_gaussian(seed, channel, first + k);
    }
}

VI_DOOR void vi_door_digitised(size_t count, const double volts[], double highest, int bits, double digitised[])
{
    for (size_t k = 0; k < count; ++k) {
        digitised[k] = vi_digitised(volts[k], highest, bits);
    }
}

VI_DOOR void vi_door_reading(size_t count, const double values[], double gain, double offset, double highest,
                             double volts[])
{
    const vi_reading reading = {gain, offset, highest};
    for (size_t k = 0; k < count; ++k) {
        volts[k] = vi_reading_of(&reading, values[k]);
    }
}

VI_DOOR size_t vi_door_magnet(size_t count, const double volts[], const double displacements[], double gain,
                              double offset, double distance, int side, double forces[])
{
    const vi_magnet magnet = {gain, offset, distance, side};
    for (size_t k = 0; k < count; ++k) {
        if (!(vi_magnet_gap(&magnet, displacements[k]) > 0.0)) {
            return k;
        }
        forces[k] = vi_magnet_force(&magnet, volts[k], displacements[k]);
    }
    return count;
}
