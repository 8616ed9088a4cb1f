/* What a sensor says of what it measures: gain * value + offset, in V. */
#ifndef VIBROIMPACT_READING_H
#define VIBROIMPACT_READING_H

typedef struct {
    double gain;    /* V per unit of the value */
    double offset;  /* V */
    double highest; /* V; the reading ends at +-highest, 0: nowhere */
} vi_reading;

/* A value that is not a number is none in the reading. */
double vi_reading_of(const vi_reading *reading, double value);

/* `volts`, ended at +-highest; 0: as it is. */
double vi_ended(double volts, double highest);

#endif
