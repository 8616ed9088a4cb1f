#include "structure_signals.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "body/signal_check.h"
#include "hash.h"

/* Number of signals in use: up to the last one of any kind. */
static int used(const vi_structure_signals *signals)
{
    int count = VI_SIGNALS;
    while (count > 0 && signals->signal[count - 1].kind == VI_NO_SIGNAL) {
        --count;
    }
    return count;
}

/* Are the rows of the signal's table rows of all tables? */
static bool has_rows(const vi_structure_signal *signal)
{
    return signal->table_count >= 0 && signal->table_count <= VI_TABLE_ROOM && signal->table_start >= 1
           && signal->table_start <= VI_TABLE_ROOM + 1 - signal->table_count;
}

static vi_table table_of(const vi_structure_signals *signals, int k)
{
    const vi_structure_signal *signal = &signals->signal[k];
    const int64_t first = signal->table_start - 1;
    return (vi_table){(int)signal->table_count, signals->time + first, signals->value + first, NULL};
}

static vi_signal signal_of(const vi_structure_signals *signals, int k)
{
    const vi_structure_signal *signal = &signals->signal[k];
    return (vi_signal){
        .kind = vi_signal_kind_of(signal->kind), .start = signal->start, .duration = signal->duration,
        .angular_frequency = signal->angular_frequency, .end_angular_frequency = signal->end_angular_frequency,
        .phase = signal->phase, .rise = signal->rise, .seed = (uint64_t)signal->seed, .table = table_of(signals, k),
    };
}

void vi_structure_check_amplitudes(const vi_structure_signals *signals, char message[VI_MESSAGE_LENGTH])
{
    for (int k = 0; k < VI_SIGNALS; ++k) {
        if (!isfinite(signals->amplitude[k])) {
            vi_complain(message, "signal[%d].amplitude: expected a finite number, got %.17g", k + 1,
                        signals->amplitude[k]);
        }
    }
}

/* Complain of two cubic tables that share rows but are not the same table: a row has one second derivative. */
static void check_shared_rows(const vi_structure_signals *signals, int k, char *message)
{
    const vi_structure_signal *one = &signals->signal[k];
    for (int i = 0; i < k; ++i) {
        const vi_structure_signal *other = &signals->signal[i];
        const bool cubic = one->kind == VI_TABLE_CUBIC && other->kind == VI_TABLE_CUBIC;
        const bool same = one->table_start == other->table_start && one->table_count == other->table_count;
        if (cubic && !same && one->table_start < other->table_start + other->table_count
            && other->table_start < one->table_start + one->table_count) {
            vi_complain(message, "signal[%d].table_start: expected all rows of signal[%d], or none of them, for two cubic"
                                 " tables, got some", k + 1, i + 1);
        }
    }
}

void vi_structure_check_signals(const vi_structure_signals *signals, int modes, char message[VI_MESSAGE_LENGTH])
{
    for (int k = 0; k < used(signals); ++k) {
        char name[32];
        (void)snprintf(name, sizeof name, "signal[%d]", k + 1);
        vi_check_each(message, vi_check_finite, "mode.signal", signals->force[k], modes);
        if (!has_rows(&signals->signal[k])) {
            vi_complain(message, "%s.table_start: expected rows 1 to %d of table.time, got %lld and %lld rows", name,
                        VI_TABLE_ROOM, (long long)signals->signal[k].table_start,
                        (long long)signals->signal[k].table_count);
            continue;
        }
        const vi_signal signal = signal_of(signals, k);
        vi_check_signal(message, name, &signal);
        check_shared_rows(signals, k, message);
    }
}

uint64_t vi_structure_signals_key(const vi_structure_signals *signals)
{
    const int count = used(signals);
    uint64_t key = vi_hash(VI_HASH_START, signals->signal, (size_t)count * sizeof signals->signal[0]);
    for (int k = 0; k < count; ++k) {
        const vi_table table = table_of(signals, k);
        key = vi_hash(key, table.time, (size_t)table.count * sizeof table.time[0]);
        key = vi_hash(key, table.value, (size_t)table.count * sizeof table.value[0]);
    }
    return count > 0 ? key | 1u : 0u;
}

void vi_structure_make_signals(const vi_structure_signals *signals, vi_signal_loads *loads)
{
    loads->count = used(signals);
    loads->amplitude = signals->amplitude;
    loads->force = signals->force;
    for (int k = 0; k < loads->count; ++k) {
        vi_signal *signal = &loads->signal[k];
        *signal = signal_of(signals, k);
        signal->random = &loads->random[k];
        signal->transform = &loads->transform;
        if (signal->kind == VI_TABLE_CUBIC) {
            double *const bend = loads->bend + (signals->signal[k].table_start - 1);
            vi_table_bend(signal->table.count, signal->table.time, signal->table.value, bend);
            signal->table.bend = bend;
        }
        vi_signal_prepare(signal);
    }
}

double vi_structure_base_of_signals(const vi_structure_signals *signals, const double value[])
{
    double sum = 0.0;
    for (int k = 0; k < used(signals); ++k) {
        sum += signals->signal[k].of_base ? signals->amplitude[k] * value[k] : 0.0;
    }
    return sum;
}
