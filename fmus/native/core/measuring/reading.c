#include "measuring/reading.h"

/* Comparisons keep NaN; fmin would turn it into the end of the range. */
double vi_ended(double volts, double highest)
{
    if (!(highest > 0.0)) {
        return volts;
    }
    return volts > highest ? highest : volts < -highest ? -highest : volts;
}

double vi_reading_of(const vi_reading *reading, double value)
{
    return vi_ended(reading->gain * value + reading->offset, reading->highest);
}
