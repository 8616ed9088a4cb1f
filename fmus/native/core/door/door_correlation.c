#include "door/door_correlation.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>

#include "door/correlation.h"
#include "door/door.h"

VI_DOOR size_t vi_door_correlation_padding(void)
{
    return VI_CORRELATION_PADDING;
}

VI_DOOR size_t vi_door_correlation_tables(void)
{
    return VI_CORRELATION_TABLES;
}

/* Is a number 1, 9/8, ... 15/8 times a power of two, far enough from the ends of the range? */
static bool on_ladder(double lowest)
{
    int exponent;
    if (!(lowest >= DBL_MIN * 2.0) || !(lowest <= 1e150)) {
        return false;
    }
    const double steps = 2.0 * VI_RADII_PER_OCTAVE * frexp(lowest, &exponent);
    return steps >= floor(steps) && steps <= floor(steps);
}

VI_DOOR int vi_door_correlation_add(const double value[], size_t count, size_t first, size_t last, size_t step,
                                    int embedding, double lowest, int radii, uint64_t joint[])
{
    const vi_radius_ladder ladder = {lowest, radii};
    if (first < 1 || step < 1 || embedding < 1 || embedding > VI_MOST_EMBEDDING || radii < 2
        || radii > VI_MOST_RADII || !on_ladder(lowest)) {
        return 1;
    }
    for (size_t j = count; j < count + VI_CORRELATION_PADDING; ++j) {
        if (!isnan(value[j])) {
            return 1;
        }
    }
    vi_correlation_add(value, count, first, last, step, embedding, &ladder, joint);
    return 0;
}
