// Where Nextflow isn't to be had: its pipeline evaluated by Groovy, the language that it is written in, with the engine's words stood in
// for, and the script of every process run by bash, one after the other. It shows what is run with which words; nothing of Nextflow.
//
// Usage: groovy nextflow_scripts.groovy MAIN.nf WORK [--NAME VALUE]...

import java.nio.file.Files
import java.nio.file.Path
import java.nio.file.Paths
import org.codehaus.groovy.control.CompilerConfiguration

/** A channel whose items are all there. */
class Channel {
    List items

    Channel splitText() { new Channel(items: items.collectMany { file -> file.toFile().readLines().collect { it + '\n' } }) }
    Channel map(Closure change) { new Channel(items: items.collect(change)) }
    Channel filter(Closure test) { new Channel(items: items.findAll(test)) }
    Channel buffer(Map options) { new Channel(items: items.collate(options.size, options.remainder)) }
    Channel collect() { new Channel(items: [items]) }
}

/** What the command line gives comes before what the pipeline sets. */
class Parameters {
    Map given, defaults = [:]

    void propertyMissing(String name, value) { defaults[name] = value }
    def propertyMissing(String name) { given.containsKey(name) ? given[name] : defaults[name] }
}

class Memory {
    long bytes

    long toMega() { bytes >> 20 }
}

/** What a process's words mean: its input, of which it has one at most, what it asks for, the file that it makes. */
class Directives {
    def input
    String inputName
    Map task = [:]
    String output

    def path(String name) { output = name }
    def memory(Memory memory) { task.memory = memory }
    def propertyMissing(String name) {
        // The first mention declares it; `params` is the pipeline's.
        if (name != 'params') inputName = inputName ?: name
        if (name != inputName) throw new MissingPropertyException(name, Directives)
        input
    }
    // `val`, `cpus`, `tag`, `executor` change nothing of the script.
    def methodMissing(String name, arguments) { null }
}

abstract class Pipeline extends Script {
    static Path work
    static Map bodies = [:], made = [:], runs = [:]

    def process(Map process) { bodies[process.name] = process.body }
    def file(path) { Paths.get(path.toString()) }
    def error(String text) { throw new IllegalArgumentException(text) }
    def workflow(Closure body) { body() }
    def propertyMissing(String name) { [out: made[name]] }

    /** `process NAME { … }` calls NAME with its body, a workflow with channels. */
    def methodMissing(String name, arguments) {
        if (!bodies.containsKey(name)) return [name: name, body: arguments[0]]
        def inputs = arguments ? arguments[0].items : [null]
        runs[name] = inputs.size()
        made[name] = new Channel(items: inputs.withIndex().collect { input, n -> execute(name, n, input) })
    }

    static execute(String name, int number, input) {
        def directives = new Directives(input: input)
        def body = bodies[name].rehydrate(directives, bodies[name].owner, bodies[name].thisObject)
        body.resolveStrategy = Closure.DELEGATE_FIRST
        def script = body().toString()
        def folder = Files.createDirectories(work.resolve(name + number))
        def file = folder.resolve('command.sh')
        file.toFile().text = script
        def ended = new ProcessBuilder('bash', '-e', file.toString()).directory(folder.toFile()).inheritIO().start().waitFor()
        if (ended) throw new IllegalStateException("$name: exit code $ended of:\n$script")
        directives.output ? folder.resolve(directives.output) : true
    }
}

Integer.metaClass.getGB = { -> new Memory(bytes: (delegate as long) << 30) }
def given = args.toList().drop(2).collate(2).collectEntries { [(it[0].substring(2)): it[1]] }
Pipeline.work = Paths.get(args[1]).toAbsolutePath()
def language = new CompilerConfiguration(scriptBaseClass: Pipeline.name)
def binding = new Binding(nextflow: [enable: [:]], params: new Parameters(given: given))
new GroovyShell(getClass().classLoader, binding, language).evaluate(new File(args[0]))
println Pipeline.runs
