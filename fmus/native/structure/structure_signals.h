/* The signals of time among the forces of a Structure. */
#ifndef VIBROIMPACT_STRUCTURE_SIGNALS_H
#define VIBROIMPACT_STRUCTURE_SIGNALS_H

#include <stdint.h>

#include "body/modal/loads.h"

/* Parameters of a signal; members as in vi_signal. */
typedef struct {
    int64_t kind, seed;
    int64_t table_start, table_count; /* rows of the table, from 1 */
    double start, duration, angular_frequency, end_angular_frequency, phase, rise;
    int32_t of_base; /* an acceleration of the base */
    int32_t unused;  /* 0, instead of padding: signals are compared by their bytes */
} vi_structure_signal;

/* All signals, with the tables behind each other. */
typedef struct {
    vi_structure_signal signal[VI_SIGNALS];
    double amplitude[VI_SIGNALS];
    double force[VI_SIGNALS][VI_MODES]; /* modal forces for the amplitude 1 */
    double time[VI_TABLE_ROOM], value[VI_TABLE_ROOM];
} vi_structure_signals;

/* Complain of signals and tables, without amplitudes, for bodies of `modes` modes. */
void vi_structure_check_signals(const vi_structure_signals *signals, int modes, char message[VI_MESSAGE_LENGTH]);

/* Complain of the amplitudes, which are tunable. */
void vi_structure_check_amplitudes(const vi_structure_signals *signals, char message[VI_MESSAGE_LENGTH]);

/* Hash of the parameters without amplitudes and forces; 0: there are no signals. */
uint64_t vi_structure_signals_key(const vi_structure_signals *signals);

/* Make the signals of valid parameters. */
void vi_structure_make_signals(const vi_structure_signals *signals, vi_signal_loads *loads);

/* Acceleration of the base by signals of these values, m/s^2. */
double vi_structure_base_of_signals(const vi_structure_signals *signals, const double value[]);

#endif
