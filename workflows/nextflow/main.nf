// The cases of a cohort as tasks of Nextflow: each is one `glioscope cohort … participant`, and the last writes the tables.
//
//   nextflow run workflows/nextflow/main.nf -profile local --input IN --output OUT --options '--compute metrics,lesions'
//
// A case that fails doesn't stop the others: its exit code 1 is taken, and tables/failures.csv has it. What is done and still matches its
// inputs isn't computed again.

nextflow.enable.dsl = 2

params.input = null
params.output = null
params.glioscope = 'glioscope'
params.options = ''
params.group_options = ''
params.list_options = ''
// Cases in a task, one after the other.
params.batch = 1

def quoted(text) { "'" + text.toString().replace("'", "'\\''") + "'" }

process LABELS {
    executor 'local'

    output:
    path 'labels.txt'

    script:
    """
    ${params.glioscope} cohort ${quoted(file(params.input).toAbsolutePath())} ${quoted(file(params.output).toAbsolutePath())} \
        participant --list ${params.list_options} > labels.txt
    """
}

process CASES {
    tag { labels.size() == 1 ? labels[0] : "${labels[0]} and ${labels.size() - 1} more" }
    cpus 2
    memory 2.GB

    input:
    val labels

    output:
    val true

    script:
    """
    ${params.glioscope} cohort ${quoted(file(params.input).toAbsolutePath())} ${quoted(file(params.output).toAbsolutePath())} \
        participant ${params.options} --n-procs 1 --mem-mb ${task.memory.toMega()} \
        --participant-label ${labels.collect { quoted(it) }.join(' ')} || [ \$? -eq 1 ]
    """
}

process TABLES {
    memory 2.GB

    input:
    val all

    script:
    """
    ${params.glioscope} cohort ${quoted(file(params.input).toAbsolutePath())} ${quoted(file(params.output).toAbsolutePath())} \
        group ${params.group_options}
    """
}

workflow {
    if (!params.input || !params.output) {
        error '--input and --output: found none, expected the data set and the folder of results'
    }
    labels = LABELS().splitText().map { it.trim() }.filter { it }.buffer(size: params.batch as int, remainder: true)
    CASES(labels)
    TABLES(CASES.out.collect())
}
