/* Output of a sensor for a measured value: gain * value + offset, V. */
#ifndef VIBROIMPACT_READING_H
#define VIBROIMPACT_READING_H

typedef struct {
    double gain;    /* V per unit of the value */
    double offset;  /* V */
    double highest; /* V; the reading is clipped at +-highest, 0: no clipping */
} vi_reading;

/* NaN stays NaN. */
double vi_reading_of(const vi_reading *reading, double value);

/* `volts` clipped at +-highest; 0: no clipping. */
double vi_ended(double volts, double highest);

#endif
