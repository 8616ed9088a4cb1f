#include "door/door_modes.h"

#include <stdbool.h>

#include "door/door.h"
#include "modes/beam_modes.h"

static bool in_range(int boundary, int count)
{
    return boundary >= VI_CLAMPED_FREE && boundary <= VI_PINNED_PINNED && count >= 1;
}

static bool on_beam(int points, const double s[])
{
    for (int k = 0; k < points; ++k) {
        if (!(s[k] >= 0.0 && s[k] <= 1.0)) {
            return false;
        }
    }
    return true;
}

VI_DOOR int vi_door_beam_modes(int boundary, int count, double eigenvalue[], double participation[])
{
    if (!in_range(boundary, count)) {
        return 1;
    }
    for (int j = 1; j <= count; ++j) {
        eigenvalue[j - 1] = vi_beam_eigenvalue((vi_beam_boundary)boundary, j);
        participation[j - 1] = vi_beam_participation((vi_beam_boundary)boundary, j);
    }
    return 0;
}

VI_DOOR int vi_door_beam_shapes(int boundary, int count, int points, const double s[], int derivative, double shape[])
{
    if (!in_range(boundary, count) || !on_beam(points, s) || derivative < 0 || derivative > 3) {
        return 1;
    }
    for (int k = 0; k < points; ++k) {
        for (int j = 1; j <= count; ++j) {
            shape[k * count + j - 1] = vi_beam_shape((vi_beam_boundary)boundary, j, s[k], derivative);
        }
    }
    return 0;
}
